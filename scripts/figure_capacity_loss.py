"""Figure: capacity of one cell lost to temperature and rate."""

import figure
from drawing import capacity_loss
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(capacity_loss.draw(job.load(snakemake.input[0])), job)
