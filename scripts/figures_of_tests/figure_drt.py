"""Figure: distributions of relaxation times of one cell."""

from figures import impedance, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    style.save(impedance.draw_relaxation_times(artefact.load_together(pairs)), job)
