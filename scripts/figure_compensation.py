"""Figure: temperatures that a cell's model was not told of."""

import figure
from drawing import compensation
from runtime import artefact

with artefact.Job(snakemake) as job:
    laws = artefact.rows(job.load(snakemake.input.laws))
    proof = artefact.rows(job.load(snakemake.input.proof))
    figure.save(compensation.draw(laws, proof), job)
