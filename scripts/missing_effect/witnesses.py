"""Which independent measurements of a cell agree with its verdict, contradict it, or are silent."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    known = job_inputs.measurements(inputs, params.tests)
    found = cw.witnesses(
        job.load(inputs.verdict),
        job.load(inputs.model),
        job.load(inputs.basis),
        known | {"series": job.load(inputs.series)},
        ambient_celsius=params.ambient_celsius,
    )
    job.save(found.rows)
