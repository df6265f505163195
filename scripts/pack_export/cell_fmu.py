"""A cell's model as a functional mock-up unit for other simulators."""

import cellwright_fmu
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    found = cellwright_fmu.cell_fmu(
        job.load(snakemake.input.model),
        capacities=job_inputs.rows_of_tests(snakemake.input.capacities),
        validation=job_inputs.rows_of_tests(snakemake.input.validation),
    )
    job.note(*found.notes)
    job.save(found.content, token=found.token, platform=found.platform)
