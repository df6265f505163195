"""Figure: circuits of one cell's pulses by each identification method."""

from figures import identification_methods, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    rows = artefact.rows(job.load(snakemake.input[0]))
    style.save(identification_methods.draw_identification_methods(rows), job)
