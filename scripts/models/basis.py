"""What the SoC of one cell refers to: capacity and OCV, its own or borrowed."""

from cellwright.records.basis import basis
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = basis(
        snakemake.wildcards.cell,
        lending.curves(inputs.ocv),
        lending.capacities(inputs.capacity),
        lending.lenders(inputs.lent_ocv, inputs.lent_capacity, params.references),
        rests=lending.curves(inputs.rests),
        rated_capacity_ampere_hour=params.cell["rated_capacity_ampere_hour"],
        lower_cutoff_volt=params.cell["lower_cutoff_volt"],
    )
    job.note(*lending.sentences(found))
    job.save(found)
