"""Figure: incremental capacity of one cell."""

from figures import capacity, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    style.save(capacity.draw_ica(artefact.load_together(pairs)), job)
