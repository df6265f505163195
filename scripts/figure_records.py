"""Figure: the records of one cell, coloured by step."""

import figure
from drawing import records
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.series, snakemake.input.steps, strict=True)
    found = artefact.load_together(pairs)
    figure.save(records.draw(found, snakemake.params.total), job)
