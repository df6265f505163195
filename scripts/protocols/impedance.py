"""Fit a circuit to one spectrum, test the spectrum itself, and find its relaxation times."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    output = snakemake.output
    found = cw.impedance(job.load(snakemake.input.spectrum), snakemake.params.settings)
    job.note(*found.notes)
    job.save([found.row], output.fit)
    job.save(found.curve, output.curve)
    job.save(found.parameters, output.parameters)
    job.save(found.candidates, output.candidates)
    job.save(found.distribution, output.distribution)
    job.save(found.processes, output.processes)
