"""Incremental capacity of the constant-current charge in one test, and its peaks."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    record = job.load(snakemake.input.series), job.load(snakemake.input.steps)
    found = cw.ica(*record)
    job.note(*found.notes)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, snakemake.output.curve, c_rate=found.c_rate, **facts)
    peaks = cw.ica_peaks(found)
    job.save(peaks.rows, snakemake.output.peaks)
