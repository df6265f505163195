"""What the SoC of one cell refers to: capacity and OCV, its own or borrowed."""

import artefact
import lending
from cellwright.models.basis import basis

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = basis(
        snakemake.wildcards.cell,
        lending.curves(inputs.ocv),
        lending.capacities(inputs.capacity),
        lending.lenders(inputs.lent_ocv, inputs.lent_capacity, params.references),
        rated_capacity_ampere_hour=params.cell["rated_capacity_ampere_hour"],
    )
    job.note(*lending.sentences(found))
    job.save(found)
