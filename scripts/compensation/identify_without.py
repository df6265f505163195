"""Identify the chosen member of a cell's model anew, without the tests of one temperature."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    found = cw.identify_without(
        params.cell,
        job.load(inputs.whole),
        job.load(inputs.basis),
        job_inputs.tests(inputs.series),
        celsius=float(snakemake.wildcards.celsius),
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.content)
