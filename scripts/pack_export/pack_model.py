"""The model of a pack as one document, with the errors that its tests have shown."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, output, params = snakemake.input, snakemake.output, snakemake.params
    found = cw.assemble_pack(
        snakemake.wildcards.group,
        params.rows,
        [job.load(path) for path in inputs.models],
        capacities=job_inputs.rows_of_tests(inputs.capacities),
        validation=job_inputs.rows_of_tests(inputs.validation),
        group_tests=job_inputs.rows_of_tests(inputs.tests),
        thermal=[content for content, _ in artefact.load_all(inputs.thermal)],
    )
    job.note(*found.notes)
    job.save(found.content, output.model)
    job.save(found.lookup, output.lookup)
