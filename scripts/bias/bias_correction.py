"""Model of a cell without pulses from the reference cell of its type."""

import cellwright as cw
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    own = lending.cell_shows(inputs.basis, None, lending.shown_paths(inputs), params.references)
    peers = [lending.cell_shows(*paths, params.references) for paths in lending.peer_paths(inputs)]
    found = cw.borrow_model(own, peers)
    job.note(*found.notes)
    job.save(found.content)
