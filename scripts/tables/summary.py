"""What was left out and why, one row per cell, and the results held against tests/artefacts."""

from pathlib import Path

from runtime import artefact, results_check, tables

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake, output.excluded, inputs=inputs.stages) as job:
    job.save(tables.excluded(inputs.stages, params.files))
sources = [*inputs.tables, output.excluded]
with artefact.Job(snakemake, output.summary, inputs=[*sources, *inputs.models]) as job:
    frames = tables.load_frames(sources)
    models = tables.load_models(inputs.models)
    job.save(tables.summary(params.cells, frames, models, job.log))
checked = [*sources, output.summary, *inputs.laws]
with artefact.Job(snakemake, output.checks, inputs=checked) as job:
    job.save(results_check.outcomes(Path(output.excluded).parent))
