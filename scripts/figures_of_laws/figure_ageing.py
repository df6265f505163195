"""Figure: capacities of one ageing record over cycles and temperature, and their periods."""

from figures import ageing, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    (summary,) = artefact.rows(job.load(snakemake.input.summary))
    cycles, periods = job.load(snakemake.input.cycles), job.load(snakemake.input.periods)
    style.save(ageing.draw_ageing(cycles, periods, summary), job)
