"""Figure of a cell: its pulses by each identification method."""

from figures import methods, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    rows = artefact.rows(job.load(snakemake.input[0]))
    style.save(methods.draw_identification_methods(rows), job)
