"""Figure: resistance and capacity of one cell over temperature."""

import figure
from drawing import temperature
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = job.load(snakemake.input.points)
    laws = artefact.rows(job.load(snakemake.input.laws))
    figure.save(temperature.draw(points, laws), job)
