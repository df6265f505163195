"""How much a fast charge puts in, and what limits it."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.basis)]
    known = {name: params.test[name] for name in ("cycle", "soc")}
    found = cw.fast_charge(*record, params.cell, params.settings, **known)
    job.note(*found.notes)
    job.save(found.rows)
