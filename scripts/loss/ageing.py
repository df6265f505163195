"""Complete cycles of one ageing record; fade, temperature and daily cycle of their capacities."""

import cellwright as cw
from runtime import artefact, job_inputs

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake, output.cycles) as counting:
    record = counting.load(inputs.series), counting.load(inputs.steps)
    facts_of_test, course = (
        job_inputs.facts_of_job(snakemake)[0],
        artefact.load_first(inputs.course),
    )
    found = cw.ageing_cycles(*record, facts_of_test, params.cell, course, params.instrument)
    counting.note(*found.notes)
    counting.save(found.rows, left_out=list(found.left_out))
with artefact.Job(snakemake, *output[1:], after=counting) as job:
    test = {"test": snakemake.wildcards.test, "kind": "ageing"}
    found = cw.ageing_over_temperature(job.load(output.cycles), test)
    job.note(*found.notes)
    job.save([found.summary], output.summary)
    job.save(found.rows, output.laws)
    job.save(found.cycles, output.compensated)
    job.save(found.periodogram, output.periodogram)
