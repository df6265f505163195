"""Model of a cell without pulses from the reference cell of its type."""

import cellwright as cw
from runtime import artefact, type_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    own = type_inputs.cell_shows(
        inputs.basis, None, type_inputs.shown_paths(inputs), params.references
    )
    peers = [
        type_inputs.cell_shows(*paths, params.references)
        for paths in type_inputs.peer_paths(inputs)
    ]
    found = cw.borrow_model(own, peers)
    job.note(*found.notes)
    job.save(found.content)
