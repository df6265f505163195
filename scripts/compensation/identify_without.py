"""Identify the chosen member of a cell's model anew, without the tests of one temperature."""

from cellwright.identification.cell import cell_model
from cellwright.identification.compensation import without
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    tests = facts.tests(snakemake.input.series)
    whole, basis = job.load(snakemake.input.whole), job.load(snakemake.input.basis)
    rest = without(basis, tests, celsius=float(snakemake.wildcards.celsius))
    settings = {"split_rest_second": snakemake.params.split_rest_second}
    model = cell_model(
        CellFacts(**snakemake.params.cell), *rest, members=[whole["chosen"]], **settings
    )
    job.note(*model["notes"])
    job.save(model)
