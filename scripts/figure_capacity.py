"""Figure: capacity of one cell."""

import figure
from drawing import capacity
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(capacity.draw(artefact.load_some(snakemake.input)), job)
