"""Estimate the SoC of one test that took no part in the fit by every filter, and score it."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    found = cw.estimate_soc(
        job.load(inputs.model),
        job.load(inputs.series),
        params.test,
        params.cell,
        params.settings,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
