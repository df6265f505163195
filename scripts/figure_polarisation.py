"""Figure: polarisation of one cell over SoC and over temperature."""

import figure
from drawing import polarisation
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = artefact.rows(job.load(snakemake.input.points))
    laws = artefact.rows(job.load(snakemake.input.laws))
    figure.save(polarisation.draw(points, laws), job)
