"""Figures: what one branch of a group has of its own, and how one can see it."""

import figure
from drawing import effect_group
from runtime import artefact

with artefact.Job(snakemake) as job:
    parts = {name: job.load(path) for name, path in snakemake.input.items()}
    gates = snakemake.params.gates
    for name, path in snakemake.output.items():
        figure.save(effect_group.draw(name, parts, gates), job, path)
