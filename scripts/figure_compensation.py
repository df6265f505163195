"""Figure: temperatures that a cell's model was not told of."""

import artefact
import figure
from drawing import compensation

with artefact.Job(snakemake) as job:
    laws = artefact.rows(job.load(snakemake.input.laws))
    proof = artefact.rows(job.load(snakemake.input.proof))
    figure.save(compensation.draw(laws, proof), job)
