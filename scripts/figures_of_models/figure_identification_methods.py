"""Figure: circuits of one cell's pulses by each identification method."""

from figures import models, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    rows = artefact.rows(job.load(snakemake.input[0]))
    style.save(models.draw_identification_methods(rows), job)
