"""Figures: what the model of one cell lacks, and how one can see it."""

import figure
from drawing import missing_effect
from runtime import artefact

with artefact.Job(snakemake) as job:
    parts = {name: job.load(path) for name, path in snakemake.input.items()}
    for name, path in snakemake.output.items():
        figure.save(missing_effect.draw(name, parts, snakemake.params.gates), job, path)
