"""Search for what the model in use of one cell still lacks, proved on tests that took no part."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.missing_effect(
        params.cell,
        job.load(inputs.basis),
        job_inputs.tests(inputs.series),
        params.settings,
        model=job.load(inputs.model),
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
