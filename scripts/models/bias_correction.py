"""Model of a cell without pulses from the reference cell of its type."""

from cellwright.identification.borrowed import borrowed_model
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    own = lending.shown(inputs.basis, None, inputs.peaks, inputs.onset, params.references)
    peers = [lending.shown(*paths, params.references) for paths in lending.by_cell(inputs)]
    model = borrowed_model(own, peers)
    job.note(*model["notes"])
    job.save(model)
