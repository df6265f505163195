"""Search for what the model lacks with which the user simulated tests of one cell."""

import cellwright as cw
from runtime import artefact, facts, search_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    tests = facts.tests(inputs.series)
    curves, notes = search_inputs.simulated(params.files, tests)
    job.note(*notes)
    found = cw.missing_effect(
        params.cell,
        job.load(inputs.basis),
        tests,
        params.settings,
        simulated=curves,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
