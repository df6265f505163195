"""A series pack through a record: errors, weakest cells, charge, energy, power, balancing."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs, output, params = snakemake.input, snakemake.output, snakemake.params
    models = [job.load(path) for path in inputs.models]
    test = params.test | {"test": snakemake.wildcards.test}
    record = job.load(inputs.series)
    found = cw.series_pack(models, params.members, params.cells, record, test, params.settings)
    job.note(*found.notes)
    for name in ("pack", "cells", "power", "waterfall", "series"):
        job.save(getattr(found, name), output[name])
