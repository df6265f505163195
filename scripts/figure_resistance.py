"""Figure: resistance of one cell."""

import figure
from drawing import resistance
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(resistance.draw(artefact.load_some(snakemake.input)), job)
