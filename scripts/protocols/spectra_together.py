"""All spectra of a cell together: the circuit that they prefer, and its arcs followed."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    spectra = job_inputs.tests(snakemake.input)
    found = cw.spectra_together(spectra, snakemake.params.settings)
    job.note(*found.notes)
    job.save(found.rows)
