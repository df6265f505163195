"""Figure: parameters of a cell's model over SoC."""

import artefact
import figure
from drawing import parameters

with artefact.Job(snakemake) as job:
    figure.save(parameters.draw(job.load(snakemake.input[0])), job)
