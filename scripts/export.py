"""A cell's model for other tools: PyBaMM's Thevenin model, and a look-up table."""

import artefact
from cellwright.models.exports import lookup_table, pybamm_document
from cellwright.models.instrument import words_of
from cellwright.models.over_temperature import temperature_table
from cellwright.models.plain import plain_member

with artefact.Job(snakemake) as job:
    model = job.load(snakemake.input[0])
    document = pybamm_document(model)
    job.note(*(f"{name} is not exported: {why}" for name, why in document["refused"].items()))
    for one in model["members"]:
        job.note(*(f"{one['model']}, not exported: {told}" for told in words_of(one)))
    job.save(document, snakemake.output.pybamm)
    member = plain_member(model)
    if member != model["chosen"]:
        job.note(f"the look-up table holds {member}: {model['chosen']} is more than RC pairs")
    job.save(lookup_table(model, member), snakemake.output.lookup)
    job.save(temperature_table(model, None), snakemake.output.temperature)
