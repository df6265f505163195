"""Fit a circuit to one spectrum, test the spectrum itself, and find its relaxation times."""

from cellwright.protocols.impedance import analyse
from runtime import artefact

with artefact.Job(snakemake) as job:
    spectrum, output = job.load(snakemake.input.spectrum), snakemake.output
    measured = spectrum["impedance_real_ohm"] + 1j * spectrum["impedance_imaginary_ohm"]
    celsius = spectrum.get("surface_temperature_celsius")
    settings = snakemake.params.settings
    found = analyse(spectrum["frequency_hertz"], measured, temperature_celsius=celsius, **settings)
    job.note(*found.notes)
    job.save([found.row], output.fit)
    job.save(found.curve, output.curve)
    job.save(found.parameters, output.parameters)
    job.save(found.candidates, output.candidates)
    job.save(found.distribution, output.distribution)
    job.save(found.processes, output.processes)
