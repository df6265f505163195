"""Open-circuit voltage of a cell without a slow test, from the rests of a pulse test."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.ocv_from_rests(
        job.load(inputs.series),
        job.load(inputs.steps),
        params.cell,
        params.test,
        job_inputs.capacities(inputs.capacity),
        course=artefact.load_first(inputs.course),
    )
    job.note(*found.notes)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, snakemake.output.curve, capacity_source=found.capacity_source, **facts)
    job.save(found.points, snakemake.output.points)
