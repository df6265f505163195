"""The open-circuit voltage of one cell over SoC and temperature."""

from cellwright.laws.ocv import rows
from cellwright.laws.ocv.over_temperature import over_temperature
from runtime import artefact, lean, lending, tables

with artefact.Job(snakemake) as job:
    inputs, output = snakemake.input, snakemake.output
    steps = tables.rows_of(inputs.steps, {})
    lean.import_lmfit()
    found = over_temperature(lending.curves(inputs.curves), steps, **snakemake.params.settings)
    job.note(*found.notes)
    job.save(rows.map_columns(found), output.map)
    job.save(rows.entropic_columns(found), output.entropic)
    job.save(rows.surface_columns(found), output.surface)
    job.save(rows.function_rows(found), output.functions)
    job.save(rows.law_rows(found), output.laws)
