"""The model of a cell at one of its later check-ups, from the tests of that check-up alone."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params, cycle = snakemake.input, snakemake.params, float(snakemake.wildcards.checkup)
    tests, basis = job_inputs.tests(inputs.series), cw.basis_at(job.load(inputs.basis), cycle)
    split = {"split_rest_second": params.split_rest_second}
    fitted = cw.identify(params.cell, basis, tests, members=params.members, **split)
    found = cw.finish_model(params.cell, fitted, basis, tests, **split)
    job.note(*fitted.notes, *found.notes)
    job.save(found.content, snakemake.output.model)
    job.save([row | {"cycle": cycle} for row in found.parameters], snakemake.output.parameters)
