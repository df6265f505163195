"""Flag what is corrupt in a series, remove or repair it, and keep a list of what was done."""

from cellwright import series
from runtime import artefact

with artefact.Job(snakemake) as job:
    raw = job.load(snakemake.input.series)
    found = series.clean(raw, **snakemake.params.settings)
    job.note(*found.notes)
    job.save(found.columns, snakemake.output.series)
    job.save(found.actions, snakemake.output.flags)
