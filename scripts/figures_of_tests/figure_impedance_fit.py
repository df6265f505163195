"""Figure: what the circuit leaves of the spectra of one cell."""

from figures import impedance, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(impedance.draw_impedance_fit(artefact.load_some(snakemake.input)), job)
