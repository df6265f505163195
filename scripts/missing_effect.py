"""Search for what the model of one cell lacks, and prove it on tests that took no part."""

import artefact
from cellwright.effects.finding import missing_effect
from cellwright.effects.library import LIBRARY
from cellwright.models.cell import FitTest

with artefact.Job(snakemake) as job:
    tests = [
        FitTest(about["params"]["test"] | {"test": about["wildcards"]["test"]}, series)
        for series, about in artefact.load_all(snakemake.input.series)
    ]
    basis, params = job.load(snakemake.input.basis), snakemake.params
    found = missing_effect(params.cell, basis, tests, LIBRARY, settings=params.settings)
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
