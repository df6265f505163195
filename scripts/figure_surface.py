"""Figure: resistance of one cell over SoC and temperature."""

import figure
from drawing import surface
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = job.load(snakemake.input.points)
    laws = artefact.rows(job.load(snakemake.input.laws))
    figure.save(surface.draw(points, laws), job)
