"""A cell's model for other tools: PyBaMM's Thevenin model, and a look-up table."""

from cellwright.circuits.exports import lookup_table, pybamm_document
from cellwright.circuits.instrument import words_of
from cellwright.circuits.model_file import plain_member
from cellwright.identification.compensation import temperature_table
from runtime import artefact

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
