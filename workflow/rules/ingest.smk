# Raw files to checked, cleaned and segmented series; a spectrum is read where it is fitted.


def raw_contents(wildcards):
    """What the files of a test hold that are there; what is missing the job itself will report."""
    return contents_of(TESTS[wildcards.cell, wildcards.test]["file"] or ())


raw_paths = local_files(raw_contents)


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
        reading=PLAN.reading,
        channels=PLAN.channels_of_group,
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


RECORDS = RecordPlan(PLAN, evidence_kinds=EVIDENCE_KINDS, series_kinds=SERIES_KINDS)
REPEATABLE, REPEATS = RECORDS.repeatable, RECORDS.repeats
repeats_of, course_of = RECORDS.repeats_of, RECORDS.course_of


rule repeats:
    input:
        series=RECORDS.evidence_of,
    output:
        "results/stages/repeats/{cell}/{part}.parquet",
    log:
        "logs/repeats/{cell}/{part}.log",
    wildcard_constraints:
        cell=either({*REPEATABLE["fit"], *REPEATABLE["validation"]}),
        part=either(REPEATABLE),
    params:
        roles=RECORDS.asked_roles,
    message:
        "What the tests of {wildcards.cell} for {wildcards.part} repeat of others."
    script:
        "../../scripts/ingest/repeats.py"


rule course:
    input:
        series=own(partial(RECORDS.several, "clean")),
        steps=own(partial(RECORDS.several, "segment")),
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
