"""Figure: parameters of a cell's model over SoC."""

from figures import models, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(models.draw_parameters(job.load(snakemake.input[0])), job)
