"""Figure: incremental capacity of one cell by temperature."""

import figure
from drawing import ica_temperature
from runtime import artefact

with artefact.Job(snakemake) as job:
    curves, peaks = job.load(snakemake.input.curves), job.load(snakemake.input.peaks)
    matches = artefact.rows(job.load(snakemake.input.matches))
    figure.save(ica_temperature.draw(curves, peaks, matches), job)
