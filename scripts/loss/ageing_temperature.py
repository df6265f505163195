"""Fade, temperature and daily cycle of the capacities of one ageing record."""

from cellwright.laws.ageing import cycle_temperature, law_rows
from cellwright.protocols.ageing import AgeingCycles
from runtime import artefact

with artefact.Job(snakemake) as job:
    rows = AgeingCycles(**job.load(snakemake.input[0]))
    found = cycle_temperature(rows, **snakemake.params.settings)
    job.note(*filter(None, [found.summary["reason"]]))
    job.save([found.summary], snakemake.output.summary)
    job.save(law_rows(found.summary, test=snakemake.wildcards.test), snakemake.output.laws)
    job.save(found.cycles, snakemake.output.cycles)
    job.save(found.periodogram, snakemake.output.periodogram)
