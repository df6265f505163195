"""Figure: ocv of one cell."""

import figure
from drawing import ocv
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(ocv.draw(artefact.load_some(snakemake.input)), job)
