# Raw files to checked, cleaned and segmented series; a spectrum is read where it is fitted.


def raw_files(wildcards):
    """The files of a test that are there; what is missing the job itself will report.

    They stay where the laboratory wrote them, also where artefacts lie in object storage.
    """
    row = TESTS[wildcards.cell, wildcards.test]
    return [local(file) for file in row["file"] if Path(file).is_file()]


def reading(wildcards):
    """How the sheet says that a test's files are to be read."""
    row = TESTS[wildcards.cell, wildcards.test]
    return {name: row[name] for name in ["file", "sha256", "instrument", "current_sign"]}


def channels_of_group(wildcards):
    """How many members and cells a group has, whose channels its files number; none of a cell."""
    name = wildcards.cell
    return {"members": len(BRANCHES[name]), "cells": len(LEAVES[name])} if name in BRANCHES else {}


rule series:
    input:
        raw=raw_files,
    output:
        ingest="results/ingest/{cell}/{test}.parquet",
        clean="results/clean/{cell}/{test}.parquet",
        flags="results/flags/{cell}/{test}.parquet",
        segment="results/segment/{cell}/{test}.parquet",
    log:
        "logs/series/{cell}/{test}.log",
    # Before all else: everything waits for them, the longest searches too.
    priority: 2
    params:
        reading=reading,
        channels=channels_of_group,
        clean=config["clean"],
        segment=config["segment"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Read {wildcards.cell} {wildcards.test}, flag and clean it, find its steps."
    script:
        "../../scripts/ingest/series.py"


def evidence_of(cell):
    """Clean series of the tests of a cell whose loads tell resistances and models."""
    return artefacts("clean", cell, *EVIDENCE_KINDS)


# Cells with several of them, in which one measurement may stand twice.
REPEATABLE = cells_where(lambda cell: len(evidence_of(cell)) > 1)


def repeats_of(wildcards):
    """What the tests of a cell repeat of each other, where it has several."""
    return [f"results/repeats/{wildcards.cell}.parquet"] if wildcards.cell in REPEATABLE else []


rule repeats:
    input:
        series=lambda w: evidence_of(w.cell),
    output:
        "results/repeats/{cell}.parquet",
    log:
        "logs/repeats/{cell}.log",
    wildcard_constraints:
        cell=either(REPEATABLE),
    message:
        "What the tests of {wildcards.cell} repeat of each other."
    script:
        "../../scripts/ingest/repeats.py"


def series_of(stage, cell):
    """Artefacts of one stage of all series of a cell, where it has several of them."""
    paths = artefacts(stage, cell, *SERIES_KINDS)
    return paths if len(paths) > 1 else []


def course_of(wildcards):
    """The order in time of the tests of a cell that ages: an aged cell's rest tells no state.

    A fresh cell's does, and none of its tests then hangs on another.
    """
    rows = tests(wildcards.cell, *SERIES_KINDS) if wildcards.cell in CELLS else []
    ages = [row for row in rows if row["cycle"] or row["kind"] == "ageing"]
    several = ages and series_of("clean", wildcards.cell)
    return [f"results/course/{wildcards.cell}.parquet"] if several else []


rule course:
    input:
        series=lambda w: series_of("clean", w.cell),
        steps=lambda w: series_of("segment", w.cell),
    output:
        "results/course/{cell}.parquet",
    log:
        "logs/course/{cell}.log",
    wildcard_constraints:
        cell=either(CELLS),
    params:
        cell=cell_facts,
    message:
        "Which test of {wildcards.cell} followed which, and how each left the cell."
    script:
        "../../scripts/ingest/course.py"
