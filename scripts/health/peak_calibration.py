"""Peaks of dQ/dV calibrated over the cells of one type: health of each charge, and its error."""

import cellwright as cw
from runtime import artefact, type_inputs

with artefact.Job(snakemake) as job:
    inputs, params, tests = snakemake.input, snakemake.params, snakemake.params.tests
    rows, tracked = type_inputs.peaks_of_type(inputs.tracks, inputs.peaks, tests)
    before = type_inputs.cycles_before(inputs.life_curves, rows)
    found = cw.health_from_peaks(
        rows,
        type_inputs.capacities_of_type(inputs.capacity, inputs.cycles, tests, before),
        type_inputs.curves_of_type(inputs.curves, inputs.life_curves, tests, before),
        rated_ampere_hour=params.rated_ampere_hour,
        tracked=tracked,
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.charges)
    job.save(found.information, snakemake.output.information)
