"""The open-circuit voltage of one cell over SoC and temperature."""

import artefact
import lending
import tables
from cellwright.laws import ocv_rows
from cellwright.laws.ocv_temperature import over_temperature

with artefact.Job(snakemake) as job:
    inputs, output = snakemake.input, snakemake.output
    steps = tables.rows_of(inputs.steps, {})
    found = over_temperature(lending.curves(inputs.curves), steps, **snakemake.params.settings)
    job.note(*found.notes)
    job.save(ocv_rows.map_rows(found), output.map)
    job.save(ocv_rows.entropic_rows(found), output.entropic)
    job.save(ocv_rows.table_rows(found), output.surface)
    job.save(ocv_rows.surface_rows(found), output.functions)
    job.save(ocv_rows.law_rows(found), output.laws)
