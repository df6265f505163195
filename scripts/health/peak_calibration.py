"""Peaks of dQ/dV calibrated over the cells of one type: health of each charge, and its error."""

import cellwright as cw
from runtime import artefact, peak_curves

with artefact.Job(snakemake) as job:
    inputs, params, tests = snakemake.input, snakemake.params, snakemake.params.tests
    peaks, tracked = peak_curves.peaks(inputs.tracks, inputs.peaks, tests)
    found = cw.health_from_peaks(
        peaks,
        peak_curves.capacities(inputs.capacity, inputs.cycles, tests),
        peak_curves.curves(inputs.curves, inputs.life_curves, tests),
        rated_ampere_hour=params.rated_ampere_hour,
        tracked=tracked,
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.charges)
    job.save(found.information, snakemake.output.information)
