"""Simulate a parallel group and score its branch currents."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    models = [job.load(path) for path in snakemake.input.models]
    test = snakemake.params.test | {"test": snakemake.wildcards.test}
    record = job.load(snakemake.input.series)
    rows = job_inputs.rows_of_tests(snakemake.input.capacities)
    about = snakemake.params.branches, record, test
    thermal = [content for content, _ in artefact.load_all(snakemake.input.thermal)]
    found = cw.validate_group(models, *about, rows, thermal=thermal)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.findings, snakemake.output.findings)
    job.save(found.spread, snakemake.output.spread)
    job.save(found.series, snakemake.output.series)
