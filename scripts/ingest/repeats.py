"""Which stretches the tests of one cell have in common: each is one measurement."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    found = cw.repeats(facts.tests(snakemake.input.series), roles=snakemake.params.roles)
    job.note(*found.notes)
    job.save(found.rows)
