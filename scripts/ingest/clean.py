"""Flag what is corrupt in a series, remove or repair it, and keep a list of what was done."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    found = cw.clean(job.load(snakemake.input.series), snakemake.params.settings)
    job.note(*found.notes)
    job.save(found.columns, snakemake.output.series)
    job.save(found.actions, snakemake.output.flags)
