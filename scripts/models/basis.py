"""What the SoC of one cell refers to: capacity and OCV, its own or borrowed."""

import cellwright as cw
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.basis(
        params.cell,
        lending.curves(inputs.ocv),
        lending.capacities(inputs.capacity),
        lending.lenders(inputs.lent_ocv, inputs.lent_capacity, params.references),
        rests=lending.curves(inputs.rests),
        shifts=artefact.load_first(inputs.shifts) or (),
    )
    job.note(*found.notes)
    job.save(found.content)
