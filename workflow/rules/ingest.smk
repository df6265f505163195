# Raw files to checked, cleaned and segmented series; a spectrum is read where it is fitted.


def raw_paths(wildcards):
    """The files of a test that are there, which stay where the laboratory wrote them.

    Also where artefacts lie in object storage.
    """
    return [local(file) for file in raw_contents(wildcards)]


def raw_contents(wildcards):
    """What the files of a test hold that are there; what is missing the job itself will report."""
    return contents_of(TESTS[wildcards.cell, wildcards.test]["file"] or ())


def reading(wildcards):
    """How the sheet says that a test's files are to be read."""
    row = TESTS[wildcards.cell, wildcards.test]
    names = ["file", "sha256", "instrument", "current_sign", "columns"]
    return {name: row[name] for name in names}


def channels_of_group(wildcards):
    """How many members and cells a group has, whose channels its files number; none of a cell."""
    name = wildcards.cell
    return {"members": len(BRANCHES[name]), "cells": len(LEAVES[name])} if name in BRANCHES else {}


rule series:
    input:
        raw=raw_paths,
    output:
        ingest="results/stages/ingest/{cell}/{test}.parquet",
        clean="results/stages/clean/{cell}/{test}.parquet",
        flags="results/stages/flags/{cell}/{test}.parquet",
        segment="results/stages/segment/{cell}/{test}.parquet",
    log:
        "logs/series/{cell}/{test}.log",
    # Before all else: everything waits for them, the longest searches too.
    priority: 2
    params:
        content=raw_contents,
        reading=reading,
        channels=channels_of_group,
        largest_megabyte=config["files"]["largest_megabyte"],
        longest_minute=config["files"]["longest_reading_minute"],
        clean=config["clean"],
        segment=config["segment"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Read {wildcards.cell} {wildcards.test}, flag and clean it, find its steps."
    script:
        "../../scripts/ingest/series.py"


# Tests that are asked what they repeat, and those in which it may count instead: a test that may be
# fitted repeats nothing of one that may not, so that another drive leaves what is fitted alone.
COUNTED_IN = {"fit": ["fit"], "validation": ["fit", "validation", "split"]}


def evidence_of(cell, part):
    """Clean series of the tests of a cell whose loads tell resistances and models."""
    return artefacts("clean", cell, *EVIDENCE_KINDS, roles=COUNTED_IN[part])


# Cells with several of them, in which one measurement may stand twice.
REPEATABLE = {
    part: dict.fromkeys(cell for cell in CELLS if len(evidence_of(cell, part)) > 1)
    for part in COUNTED_IN
}
REPEATS = [
    f"results/stages/repeats/{cell}/{part}.parquet"
    for part in REPEATABLE
    for cell in REPEATABLE[part]
]


def repeats_of(wildcards):
    """What a test of a cell repeats of others, where there are any."""
    cell, role = wildcards.cell, TESTS[wildcards.cell, wildcards.test]["role"]
    part = "fit" if role == "fit" else "validation"
    return [f"results/stages/repeats/{cell}/{part}.parquet"] if cell in REPEATABLE[part] else []


rule repeats:
    input:
        series=lambda w: evidence_of(w.cell, w.part),
    output:
        "results/stages/repeats/{cell}/{part}.parquet",
    log:
        "logs/repeats/{cell}/{part}.log",
    wildcard_constraints:
        cell=either({*REPEATABLE["fit"], *REPEATABLE["validation"]}),
        part=either(COUNTED_IN),
    params:
        roles=lambda w: ["fit"] if w.part == "fit" else ["validation", "split"],
    message:
        "What the tests of {wildcards.cell} for {wildcards.part} repeat of others."
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
    return [f"results/stages/course/{wildcards.cell}.parquet"] if several else []


rule course:
    input:
        series=own(partial(series_of, "clean")),
        steps=own(partial(series_of, "segment")),
    output:
        "results/stages/course/{cell}.parquet",
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
