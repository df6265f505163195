"""Figure: state of charge of one test by filters."""

from figures import models, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    series = job.load(snakemake.input.series)
    scores = artefact.rows(job.load(snakemake.input.scores))
    style.save(models.draw_soc(series, scores, snakemake.wildcards.test), job)
