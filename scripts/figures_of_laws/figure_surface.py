"""Figure: resistance of one cell over SoC and temperature."""

from figures import resistance, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = job.load(snakemake.input.points)
    laws = artefact.rows(job.load(snakemake.input.laws))
    style.save(resistance.draw_resistance_surface(points, laws), job)
