"""All spectra of a cell together: the circuit that they prefer, and its arcs followed."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    spectra = facts.tests(snakemake.input)
    found = cw.spectra_together(spectra, snakemake.params.settings)
    job.note(*found.notes)
    job.save(found.rows)
