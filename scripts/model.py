"""A cell's model as the rest of the pipeline uses it, with the effects found in it, and as rows."""

import artefact
import lending
from cellwright.effects.in_model_file import with_effects
from cellwright.models.compensation import laws_kept, with_laws
from cellwright.models.rows import model_of, parameter_rows

with artefact.Job(snakemake) as job:
    model = model_of(job.load(snakemake.input.source), snakemake.wildcards.cell)
    for tried, _ in artefact.load_all(snakemake.input.law):
        model = with_laws(model, laws_kept(artefact.rows(tried)))
    tests = lending.tests(snakemake.input.series)
    settings = {"split_rest_second": snakemake.params.split_rest_second}
    searched = [found for found, _ in artefact.load_all(snakemake.input.effects)]
    for found in (one for one in searched if one["effects"]):
        model = with_effects(model, found, snakemake.params.cell, tests, **settings)
        job.note(model["choice"])
    job.save(model, snakemake.output.model)
    job.save(parameter_rows(model), snakemake.output.parameters)
