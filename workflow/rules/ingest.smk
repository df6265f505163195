# Raw files to checked, cleaned and segmented series.


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


rule ingest:
    input:
        raw=raw_files,
    output:
        "results/ingest/{cell}/{test}.parquet",
    log:
        "logs/ingest/{cell}/{test}.log",
    params:
        reading=reading,
        test=test_facts,
        cell=cell_facts,
    message:
        "Read {wildcards.cell} {wildcards.test}: columns, units, sign and clock."
    script:
        "../../scripts/ingest/ingest.py"


rule spectrum:
    input:
        raw=raw_files,
    output:
        "results/spectrum/{cell}/{test}.parquet",
    log:
        "logs/spectrum/{cell}/{test}.log",
    params:
        reading=reading,
        test=test_facts,
    message:
        "Read the impedance spectrum {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/ingest/spectrum.py"


rule clean:
    input:
        series="results/ingest/{cell}/{test}.parquet",
    output:
        series="results/clean/{cell}/{test}.parquet",
        flags="results/flags/{cell}/{test}.parquet",
    log:
        "logs/clean/{cell}/{test}.log",
    params:
        settings=config["clean"],
        test=test_facts,
    message:
        "Flag and clean {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/ingest/clean.py"


rule segment:
    input:
        series="results/clean/{cell}/{test}.parquet",
    output:
        "results/segment/{cell}/{test}.parquet",
    log:
        "logs/segment/{cell}/{test}.log",
    params:
        settings=config["segment"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Find the steps of {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/ingest/segment.py"
