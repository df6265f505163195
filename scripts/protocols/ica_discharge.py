"""Incremental capacity of the slow discharge in one test, and its peaks; empty without one."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    record = [job.load(snakemake.input[name]) for name in ("series", "steps")]
    found = cw.ica_discharge(*record, slow=snakemake.params.test["kind"] == "ocv")
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.peaks)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, snakemake.output.curve, c_rate=found.c_rate, **facts)
