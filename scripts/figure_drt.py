"""Figure: distributions of relaxation times of one cell."""

import artefact
import figure
from drawing import relaxation_times

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    figure.save(relaxation_times.draw(artefact.load_together(pairs)), job)
