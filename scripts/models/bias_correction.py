"""Model of a cell without pulses from the reference cell of its type."""

import cellwright as cw
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    own = lending.shown(inputs.basis, None, inputs.peaks, inputs.onset, params.references)
    peers = [lending.shown(*paths, params.references) for paths in lending.by_cell(inputs)]
    found = cw.borrow_model(own, peers)
    job.note(*found.notes)
    job.save(found.content)
