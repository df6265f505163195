"""Peaks of incremental capacity of one cell, matched across temperatures."""

import cellwright as cw
from runtime import artefact, type_inputs

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    charges = type_inputs.charges(pairs, snakemake.params.tests)
    found = cw.ica_over_temperature(charges)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.matches)
    job.save(found.peaks, snakemake.output.peaks)
    job.save(found.curves, snakemake.output.curves)
