"""Figure: validation of one test."""

import artefact
import figure
from drawing import validation

with artefact.Job(snakemake) as job:
    series = job.load(snakemake.input.series)
    scores = artefact.rows(job.load(snakemake.input.scores))
    figure.save(validation.draw(series, scores, snakemake.wildcards.test), job)
