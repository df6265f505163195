"""Figure: model over measurement in one test."""

from figures import models, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    series = job.load(snakemake.input.series)
    scores = artefact.rows(job.load(snakemake.input.scores))
    style.save(models.draw_validation(series, scores, snakemake.wildcards.test), job)
