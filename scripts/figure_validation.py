"""Figure: validation of one test."""

import figure
from drawing import validation
from runtime import artefact

with artefact.Job(snakemake) as job:
    series = job.load(snakemake.input.series)
    scores = artefact.rows(job.load(snakemake.input.scores))
    figure.save(validation.draw(series, scores, snakemake.wildcards.test), job)
