"""Figure: impedance of one cell."""

import artefact
import figure
from drawing import impedance

with artefact.Job(snakemake) as job:
    figure.save(impedance.draw(artefact.load_some(snakemake.input)), job)
