"""A pack's model as a functional mock-up unit for other simulators."""

import cellwright_fmu
from runtime import artefact

with artefact.Job(snakemake) as job:
    found = cellwright_fmu.pack_fmu(job.load(snakemake.input[0]))
    job.note(*found.notes)
    job.save(found.content, token=found.token, platform=found.platform)
