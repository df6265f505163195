"""Simulate a pack of groups in groups and score whatever was logged of it."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    models = [job.load(path) for path in snakemake.input.models]
    test = snakemake.params.test | {"test": snakemake.wildcards.test}
    record = job.load(snakemake.input.series)
    found = cw.nested_pack(models, snakemake.params.members, record, test)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
