"""Figure: capacity of one cell."""

import artefact
import figure
from drawing import capacity

with artefact.Job(snakemake) as job:
    figure.save(capacity.draw(artefact.load_some(snakemake.input)), job)
