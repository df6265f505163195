"""Identify the equivalent circuits of one cell from its own tests."""

from cellwright.identification.cell import cell_model
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    tests = facts.tests(snakemake.input.series)
    basis = job.load(snakemake.input.basis)
    settings = {name: snakemake.params.settings[name] for name in ("members", "split_rest_second")}
    model = cell_model(CellFacts(**snakemake.params.cell), basis, tests, **settings)
    job.note(*model["notes"])
    job.save(model)
