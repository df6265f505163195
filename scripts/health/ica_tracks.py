"""Peaks of incremental capacity of one cell, followed through its life."""

import cellwright as cw
from runtime import artefact, type_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    charges = type_inputs.charges_of_check_ups(inputs.check_ups, inputs.curves, params.tests)
    charges += type_inputs.charges_of_lives(inputs.lives, params.tests)
    found = cw.ica_tracks(charges, chemistry=params.chemistry)
    job.note(*found.notes)
    job.save(found.rows)
