"""Circuits of a cell's pulses by each identification method, side by side."""

from pulse_methods.of_cell import compare_identification_methods
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    comparison = compare_identification_methods(
        snakemake.params.cell,
        job.load(inputs.basis),
        facts.tests_with_steps(inputs.steps, inputs.series),
    )
    job.note(*comparison.notes)
    job.save(comparison.rows)
