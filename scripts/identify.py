"""Identify the equivalent circuits of one cell from its own tests."""

import artefact
from cellwright.models.cell import FitTest, cell_model

with artefact.Job(snakemake) as job:
    facts = {row["test"]: row for row in snakemake.params.tests}
    found = artefact.load_all(snakemake.input.series)
    tests = [FitTest(facts[about["wildcards"]["test"]], series) for series, about in found]
    basis = job.load(snakemake.input.basis)
    model = cell_model(snakemake.params.cell, basis, tests, **snakemake.params.settings)
    job.note(*model["notes"])
    job.save(model)
