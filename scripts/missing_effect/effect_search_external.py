"""Search for what the model lacks with which the user simulated tests of one cell."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    tests, basis = job_inputs.tests(inputs.series), job.load(inputs.basis)
    curves, notes = job_inputs.simulated(params.files, tests, cw.read_simulated, params.content)
    found = cw.missing_effect(
        params.cell,
        basis,
        tests,
        params.settings,
        simulated=curves,
        split_rest_second=params.split_rest_second,
    )
    job.note(*notes, *found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
