"""Search of one cell repeated without each of its records: which names stay."""

import cellwright as cw
from runtime import artefact, facts, search_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.missing_effect_stability(
        params.cell,
        job.load(inputs.basis),
        facts.tests(inputs.series),
        params.settings,
        references=search_inputs.references(
            params.references, inputs.lent_basis, inputs.lent_series
        ),
        split_rest_second=params.split_rest_second,
    )
    job.save(found.rows, snakemake.output.names)
    job.save(found.repeats, snakemake.output.searches)
