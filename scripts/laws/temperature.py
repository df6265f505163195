"""Resistance and capacity of one cell over temperature."""

from cellwright.laws import points as measured
from cellwright.laws.points import resistance_points
from cellwright.laws.temperature import law_rows
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    tests, inputs, settings = snakemake.params.tests, snakemake.input, snakemake.params.settings
    capacities = measured.capacity_points(tables.rows_of(inputs.capacity, tests))
    spectra = measured.impedance_points(tables.rows_of(inputs.eis, tests))
    pulses = resistance_points(tables.rows_of(inputs.resistance, tests), **settings)
    points = measured.enough([*capacities, *spectra.points, *pulses.points])
    points = measured.one_a_temperature(points)
    rows, reasons = law_rows(points)
    job.note(*spectra.notes, *pulses.notes, *reasons)
    job.save(rows, snakemake.output.laws)
    job.save(points, snakemake.output.points)
