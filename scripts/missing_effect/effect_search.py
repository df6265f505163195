"""Search for what the model of one cell lacks, and prove it on tests that took no part."""

import cellwright as cw
from runtime import artefact, facts, search_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.missing_effect(
        params.cell,
        job.load(inputs.basis),
        facts.tests(inputs.series),
        params.settings,
        references=search_inputs.references(
            params.references, inputs.lent_basis, inputs.lent_series
        ),
        measurements=search_inputs.measurements(inputs, params.tests),
        ambient_celsius=params.ambient_celsius,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
