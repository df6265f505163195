"""Complete cycles of one ageing record: capacity, energy, efficiency, temperature."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    record = job.load(snakemake.input.series), job.load(snakemake.input.steps)
    found = cw.ageing_cycles(*record, params.test, params.cell)
    job.note(*found.notes)
    job.save(found.rows)
