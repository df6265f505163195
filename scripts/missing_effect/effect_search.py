"""Search for what the model of one cell lacks, and prove it on tests that took no part."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.missing_effect(
        params.cell,
        job.load(inputs.basis),
        job_inputs.tests(inputs.series),
        params.settings,
        references=job_inputs.references(params.references, inputs.lent_basis, inputs.lent_series),
        measurements=job_inputs.measurements(inputs, params.tests),
        ambient_celsius=params.ambient_celsius,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
