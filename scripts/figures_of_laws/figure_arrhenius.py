"""Figure: Arrhenius lines of one cell."""

from figures import style, temperature
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = artefact.rows(job.load(snakemake.input.points))
    laws = artefact.rows(job.load(snakemake.input.laws))
    style.save(temperature.draw_arrhenius(points, laws), job)
