"""Figure: incremental capacity of one cell by temperature."""

from figures import capacity, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    curves, peaks = job.load(snakemake.input.curves), job.load(snakemake.input.peaks)
    matches = artefact.rows(job.load(snakemake.input.matches))
    style.save(capacity.draw_ica_temperature(curves, peaks, matches), job)
