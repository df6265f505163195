"""Figure: incremental capacity of one cell."""

import figure
from drawing import ica
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    figure.save(ica.draw(artefact.load_together(pairs)), job)
