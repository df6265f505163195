"""Figure: ocv of one cell."""

import artefact
import figure
from drawing import ocv

with artefact.Job(snakemake) as job:
    figure.save(ocv.draw(artefact.load_some(snakemake.input)), job)
