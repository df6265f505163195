"""Tests for validation at a temperature, predicted by a model that does not know it."""

from cellwright.identification.compensation import laws_kept, predicted
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    tests = facts.tests(snakemake.input.series)
    left_out = artefact.load_all(snakemake.input.left_out)
    reduced = {float(about["wildcards"]["celsius"]): model for model, about in left_out}
    whole, params = job.load(snakemake.input.whole), snakemake.params
    laws = laws_kept(artefact.rows(job.load(snakemake.input.laws)))
    settings = {"laws": laws, "proof": True, "split_rest_second": params.split_rest_second}
    rows, notes = predicted(whole, reduced, CellFacts(**params.cell), tests, **settings)
    job.note(*notes)
    job.save(rows)
