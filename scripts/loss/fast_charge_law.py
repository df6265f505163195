"""Fast charge of one cell over temperature."""

from cellwright.laws.points import enough, fast_charge_points
from cellwright.laws.temperature import law_rows
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    points = fast_charge_points(tables.rows_of(snakemake.input, snakemake.params.tests))
    rows, reasons = law_rows(enough(points))
    job.note(*reasons)
    job.save(rows, snakemake.output.laws)
    job.save(points, snakemake.output.points)
