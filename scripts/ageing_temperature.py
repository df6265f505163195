"""Fade, temperature and daily cycle of the capacities of one ageing record."""

import artefact
from cellwright.laws.ageing_rows import law_rows
from cellwright.laws.ageing_temperature import cycle_temperature
from cellwright.protocols.ageing import AgeingCycles

with artefact.Job(snakemake) as job:
    rows = AgeingCycles(**job.load(snakemake.input[0]))
    found = cycle_temperature(rows, **snakemake.params.settings)
    job.note(*filter(None, [found.summary["reason"]]))
    job.save([found.summary], snakemake.output.summary)
    job.save(law_rows(found.summary, test=snakemake.wildcards.test), snakemake.output.laws)
    job.save(found.cycles, snakemake.output.cycles)
    job.save(found.periodogram, snakemake.output.periodogram)
