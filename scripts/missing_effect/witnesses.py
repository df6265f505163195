"""Which independent measurements of a cell agree with its verdict, contradict it, or are silent."""

import cellwright as cw
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    stages = ("eis", "resistance", "relaxation", "capacity", "ocv_entropic")
    known = {stage: tables.rows_of(getattr(inputs, stage), params.tests) for stage in stages}
    found = cw.witnesses(
        job.load(inputs.verdict),
        job.load(inputs.model),
        job.load(inputs.basis),
        known | {"series": job.load(inputs.series)},
        ambient_celsius=params.ambient_celsius,
    )
    job.save(found.rows)
