"""Figure: polarisation of one cell over SoC and over temperature."""

import artefact
import figure
from drawing import polarisation

with artefact.Job(snakemake) as job:
    points = artefact.rows(job.load(snakemake.input.points))
    laws = artefact.rows(job.load(snakemake.input.laws))
    figure.save(polarisation.draw(points, laws), job)
