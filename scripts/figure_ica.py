"""Figure: incremental capacity of one cell."""

import artefact
import figure
from drawing import ica

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    figure.save(ica.draw(artefact.load_together(pairs)), job)
