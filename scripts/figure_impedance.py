"""Figure: impedance of one cell."""

import figure
from drawing import impedance
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(impedance.draw(artefact.load_some(snakemake.input)), job)
