"""Figure: resistance of one cell."""

import artefact
import figure
from drawing import resistance

with artefact.Job(snakemake) as job:
    figure.save(resistance.draw(artefact.load_some(snakemake.input)), job)
