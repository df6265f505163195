"""Figure: Arrhenius lines of one cell."""

import figure
from drawing import arrhenius
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = artefact.rows(job.load(snakemake.input.points))
    laws = artefact.rows(job.load(snakemake.input.laws))
    figure.save(arrhenius.draw(points, laws), job)
