"""Fade of one cell over its check-ups, no cycle between them being recorded."""

import cellwright as cw
from runtime import artefact

output, params = snakemake.output, snakemake.params
with artefact.Job(snakemake) as job:
    check_ups = artefact.rows(job.load(snakemake.input.check_ups))
    found = cw.fade((), params.cell, params.settings, check_ups=check_ups)
    job.note(*found.notes)
    job.save(found.laws, output.laws)
    job.save(found.columns, output.course)
    job.save([found.summary], output.life)
