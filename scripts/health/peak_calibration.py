"""Peaks of dQ/dV calibrated over the cells of one type: health of each charge, and its error."""

import cellwright as cw
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    peaks, capacities = (
        tables.rows_of(paths, params.tests) for paths in (inputs.peaks, inputs.capacity)
    )
    found = cw.health_from_peaks(
        peaks,
        capacities,
        tables.by_cell_and_test(inputs.curves),
        rated_ampere_hour=params.rated_ampere_hour,
        most_terms=params.most_terms,
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.charges)
    job.save(found.information, snakemake.output.information)
