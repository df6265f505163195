"""Figure: capacity of one cell."""

from figures import capacity, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(capacity.draw_capacity(artefact.load_some(snakemake.input)), job)
