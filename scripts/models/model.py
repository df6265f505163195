"""A cell's model as the rest of the pipeline uses it, and why its chosen member was chosen."""

from cellwright.circuits.model_file import model_of, parameter_rows
from cellwright.effects.member import finished
from cellwright.identification.compensation import laws_kept, with_laws
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    model = model_of(job.load(inputs.source), snakemake.wildcards.cell)
    for tried, _ in artefact.load_all(inputs.law):
        model = with_laws(model, laws_kept(artefact.rows(tried)))
    basis, found = artefact.load_first(inputs.basis), artefact.load_first(inputs.effects)
    about = (basis, CellFacts(**params.cell), facts.tests(inputs.series), found)
    model, choice = finished(model, *about, split_rest_second=params.split_rest_second)
    job.note(*([model["choice"]] if choice else []))
    job.save(model, snakemake.output.model)
    job.save(parameter_rows(model), snakemake.output.parameters)
    job.save(choice, snakemake.output.choice)
