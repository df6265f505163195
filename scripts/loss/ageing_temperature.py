"""Fade, temperature and daily cycle of the capacities of one ageing record."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    test = {"test": snakemake.wildcards.test, "kind": "ageing"}
    cycles = job.load(snakemake.input[0])
    found = cw.ageing_over_temperature(cycles, test, snakemake.params.settings)
    job.note(*found.notes)
    job.save([found.summary], snakemake.output.summary)
    job.save(found.rows, snakemake.output.laws)
    job.save(found.cycles, snakemake.output.cycles)
    job.save(found.periodogram, snakemake.output.periodogram)
