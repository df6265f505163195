"""What the SoC of one cell refers to: capacity and OCV, its own or borrowed."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.basis(
        params.cell,
        job_inputs.curves(inputs.ocv),
        job_inputs.capacities(inputs.capacity),
        job_inputs.lenders(inputs.lent_ocv, inputs.lent_capacity, params.references),
        rests=job_inputs.curves(inputs.rests),
        shifts=artefact.load_first(inputs.shifts) or (),
    )
    job.note(*found.notes)
    job.save(found.content)
