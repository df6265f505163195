"""Model of a cell without pulses from the reference cell of its type."""

import artefact
import showing
from cellwright.models.borrowed import borrowed_model

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    own = showing.shown(inputs.basis, None, inputs.peaks, inputs.onset, params.references)
    peers = [showing.shown(*paths, params.references) for paths in showing.by_cell(inputs)]
    model = borrowed_model(own, peers)
    job.note(*model["notes"])
    job.save(model)
