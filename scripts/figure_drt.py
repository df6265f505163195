"""Figure: distributions of relaxation times of one cell."""

import figure
from drawing import relaxation_times
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    figure.save(relaxation_times.draw(artefact.load_together(pairs)), job)
