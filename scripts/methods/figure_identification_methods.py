"""Figure: circuits of one cell's pulses by each identification method."""

import figure
from drawing import identification_methods
from runtime import artefact

with artefact.Job(snakemake) as job:
    rows = artefact.rows(job.load(snakemake.input[0]))
    figure.save(identification_methods.draw(rows), job)
