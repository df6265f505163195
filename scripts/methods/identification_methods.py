"""Circuits of a cell's pulses by each identification method, side by side."""

from cellwright.identification.methods.comparison import compare_methods
from cellwright.identification.methods.pulse_records import PulseTest
from cellwright.records.facts import CellFacts
from cellwright.series.steps import Steps
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.steps, snakemake.input.series, strict=True)
    tests = [
        PulseTest(facts.of_artefact(about), series, Steps(**steps))
        for steps, series, about in artefact.load_together(pairs)
    ]
    basis = job.load(snakemake.input.basis)
    cell = CellFacts(**snakemake.params.cell)
    found = compare_methods(tests, basis, cell, **snakemake.params.settings)
    job.note(*found.left_out)
    job.save(found.rows)
