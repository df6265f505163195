"""What was left out, a row per cell, its R0 and activation energies, results against physics."""

from pathlib import Path

from runtime import artefact, results_check, tables

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
asked = [*inputs.stages, *inputs.tables]
with artefact.Job(snakemake, output.excluded, inputs=asked) as job:
    job.save(tables.excluded(asked, params.files))
sources = [*inputs.tables, output.excluded]
with artefact.Job(snakemake, output.summary, inputs=[*sources, *inputs.models]) as job:
    frames = tables.load_frames(sources)
    models = tables.load_models(inputs.models)
    job.save(tables.summary(params.cells, frames, models, job.log))
with artefact.Job(snakemake, output.resistances, inputs=[*sources, *inputs.verdicts]) as job:
    verdicts = [found for found, _ in artefact.load_all(inputs.verdicts)]
    job.save(tables.resistances(params.cells, frames, models, verdicts, job.note))
with artefact.Job(snakemake, output.energies, inputs=[*sources, *inputs.verdicts]) as job:
    job.save(tables.energies(params.cells, frames, models, verdicts, job.note))
laws = sorted(str(law) for law in results_check.TESTS.glob("*.py"))
with artefact.Job(snakemake, output.checks, inputs=[*sources, output.summary, *laws]) as job:
    job.save(results_check.outcomes(Path(output.excluded).parent))
