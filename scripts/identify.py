"""Identify the equivalent circuits of one cell from its own tests."""

import artefact
from cellwright.models.cell import FitTest, cell_model

with artefact.Job(snakemake) as job:
    tests = [
        FitTest(about["params"]["test"] | {"test": about["wildcards"]["test"]}, series)
        for series, about in artefact.load_all(snakemake.input.series)
    ]
    basis = job.load(snakemake.input.basis)
    settings = {name: snakemake.params.settings[name] for name in ("members", "split_rest_second")}
    model = cell_model(snakemake.params.cell, basis, tests, **settings)
    job.note(*model["notes"], model["choice"])
    job.save(model)
