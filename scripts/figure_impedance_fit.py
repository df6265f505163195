"""Figure: what the circuit leaves of the spectra of one cell."""

import artefact
import figure
from drawing import impedance

with artefact.Job(snakemake) as job:
    figure.save(impedance.draw_fit(artefact.load_some(snakemake.input)), job)
