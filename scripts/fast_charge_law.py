"""Fast charge of one cell over temperature."""

import artefact
import tables
from cellwright.laws.fast_charge_points import fast_charge_points
from cellwright.laws.points import enough
from cellwright.laws.temperature import law_rows

with artefact.Job(snakemake) as job:
    points = fast_charge_points(tables.rows_of(snakemake.input, snakemake.params.tests))
    rows, reasons = law_rows(enough(points))
    job.note(*reasons)
    job.save(rows, snakemake.output.laws)
    job.save(points, snakemake.output.points)
