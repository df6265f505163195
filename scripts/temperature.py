"""Resistance and capacity of one cell over temperature."""

import artefact
import tables
from cellwright.laws.points import capacity_points, enough, resistance_points
from cellwright.laws.temperature import law_rows

with artefact.Job(snakemake) as job:
    tests, inputs = snakemake.params.tests, snakemake.input
    resistances = tables.rows_of(inputs.resistance, tests)
    capacities = tables.rows_of(inputs.capacity, tests)
    points = enough([*resistance_points(resistances), *capacity_points(capacities)])
    rows, reasons = law_rows(points)
    job.note(*reasons)
    job.save(rows, snakemake.output.laws)
    job.save(points, snakemake.output.points)
