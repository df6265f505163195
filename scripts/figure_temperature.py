"""Figure: resistance and capacity of one cell over temperature."""

import artefact
import figure
from drawing import temperature

with artefact.Job(snakemake) as job:
    points = job.load(snakemake.input.points)
    laws = artefact.rows(job.load(snakemake.input.laws))
    figure.save(temperature.draw(points, laws), job)
