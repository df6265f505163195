"""Figure: resistance of one cell."""

from figures import resistance, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(resistance.draw_resistance(artefact.load_some(snakemake.input)), job)
