"""Figure: capacities of one ageing record over cycles and temperature, and their periods."""

import figure
from drawing import ageing
from runtime import artefact

with artefact.Job(snakemake) as job:
    (summary,) = artefact.rows(job.load(snakemake.input.summary))
    cycles, periods = job.load(snakemake.input.cycles), job.load(snakemake.input.periods)
    figure.save(ageing.draw(cycles, periods, summary), job)
