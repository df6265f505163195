"""Search for what the model of one cell lacks, and prove it on tests that took no part."""

from cellwright.effects.finding import missing_effect
from cellwright.effects.library import LIBRARY
from cellwright.records.facts import CellFacts
from runtime import artefact, facts, known

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = missing_effect(
        CellFacts(**params.cell),
        job.load(inputs.basis),
        facts.tests(inputs.series),
        LIBRARY,
        settings=params.settings,
        references=known.references(params.references, inputs.lent_basis, inputs.lent_series),
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
