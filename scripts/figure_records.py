"""Figure: the records of one cell, coloured by step."""

import artefact
import figure
from drawing import records

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.series, snakemake.input.steps, strict=True)
    found = artefact.load_together(pairs)
    figure.save(records.draw(found, snakemake.params.total), job)
