"""Figures: what one branch of a group has of its own, and how one can see it."""

from figures import effects, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    parts = {name: job.load(path) for name, path in snakemake.input.items()}
    branches = effects.draw_effect_branches(parts["verdict"], parts["series"])
    style.save(branches, job, snakemake.output.branches)
    ranking = effects.draw_group_ranking(parts["ranking"], snakemake.params.gates)
    style.save(ranking, job, snakemake.output.ranking)
