"""A pack's model as a functional mock-up unit for other simulators."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    found = cw.pack_fmu(job.load(snakemake.input[0]))
    job.note(*found.notes)
    job.save(found.archive, token=found.token, platform=found.platform)
