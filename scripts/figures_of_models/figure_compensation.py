"""Figure: errors at temperatures that took no part in the fit."""

from figures import models, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    laws = artefact.rows(job.load(snakemake.input.laws))
    proof = artefact.rows(job.load(snakemake.input.proof))
    style.save(models.draw_compensation(laws, proof), job)
