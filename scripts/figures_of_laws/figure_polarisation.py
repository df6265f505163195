"""Figure: polarisation of one cell over SoC and over temperature."""

from figures import relaxation, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = artefact.rows(job.load(snakemake.input.points))
    laws = artefact.rows(job.load(snakemake.input.laws))
    style.save(relaxation.draw_polarisation(points, laws), job)
