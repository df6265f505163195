"""Figure: what the circuit leaves of the spectra of one cell."""

import figure
from drawing import impedance
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(impedance.draw_fit(artefact.load_some(snakemake.input)), job)
