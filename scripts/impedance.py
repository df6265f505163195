"""Fit the equivalent circuit to one spectrum, and test the spectrum itself."""

import artefact
from cellwright.protocols.impedance import analyse

with artefact.Job(snakemake) as job:
    spectrum = job.load(snakemake.input.spectrum)
    measured = spectrum["impedance_real_ohm"] + 1j * spectrum["impedance_imaginary_ohm"]
    found = analyse(spectrum["frequency_hertz"], measured)
    job.note(*found.notes)
    job.save([found.row], snakemake.output.fit)
    job.save(found.curve, snakemake.output.curve)
