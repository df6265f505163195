"""Figure: parameters of a cell's model over SoC."""

import figure
from drawing import parameters
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(parameters.draw(job.load(snakemake.input[0])), job)
