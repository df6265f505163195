"""Fade of one cell over its ageing records, or its check-ups: law, knee, remaining cycles."""

import cellwright as cw
from runtime import artefact, lives

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake) as job:
    if snakemake.rule == "fade":
        records = lives.records(inputs.cycles, inputs.summaries, inputs.compensated)
        found = cw.fade(records, params.cell, params.settings)
    else:
        check_ups = artefact.rows(artefact.load(inputs.check_ups))
        found = cw.fade((), params.cell, params.settings, check_ups=check_ups)
    job.note(*found.notes)
    job.save(found.laws, output.laws)
    job.save(found.columns, output.course)
    job.save([found.summary], output.life)
