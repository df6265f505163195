"""Figure: resistance and capacity of one cell over temperature."""

from figures import style, temperature
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = job.load(snakemake.input.points)
    laws = artefact.rows(job.load(snakemake.input.laws))
    style.save(temperature.draw_temperature_laws(points, laws), job)
