"""Figures of one cell or group: each from its own artefacts, whatever becomes of the others."""

from figures import of_artefacts, style
from runtime import artefact

for name, drawn in snakemake.params.figures.items():
    drawn = of_artefacts.located(drawn, snakemake.input)
    with artefact.Job(of_artefacts.part_of(snakemake, name, drawn)) as job:
        style.save(of_artefacts.draw(drawn), job)
