"""Fit a circuit to one spectrum, test the spectrum itself, find its relaxation times."""

import cellwright as cw
from runtime import artefact, job_inputs

params, inputs, output = snakemake.params, snakemake.input, snakemake.output
with artefact.Job(snakemake) as job:
    spectrum = job.load(inputs.spectrum)
    said = artefact.read_about(inputs.spectrum)["facts"]["doubt"]
    test, cell = job_inputs.facts_of_job(snakemake)
    about = {"cell": cell, "test": test, "doubt": said}
    together = artefact.load_first([inputs.together])
    found = cw.impedance(spectrum, params.settings, **about, together=together)
    job.note(*found.notes)
    job.save(found.rows, output.fit)
    job.save(found.curve, output.curve)
    job.save(found.parameters, output.parameters)
    job.save(found.candidates, output.candidates)
    job.save(found.distribution, output.distribution)
    job.save(found.processes, output.processes)
