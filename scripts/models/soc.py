"""Estimate the SoC of one test that took no part in the fit by every filter, and score it."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    estimates = cw.estimate_soc(
        job.load(inputs.model),
        job.load(inputs.series),
        *facts.of_job(snakemake),
        params.settings,
        split_rest_second=params.split_rest_second,
    )
    job.note(*estimates.notes)
    job.save(estimates.rows, snakemake.output.scores)
    job.save(estimates.series, snakemake.output.series)
