"""Figure: capacity of one cell lost to temperature and rate."""

from figures import capacity, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(capacity.draw_capacity_loss(job.load(snakemake.input[0])), job)
