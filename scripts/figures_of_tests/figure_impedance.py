"""Figure: impedance of one cell."""

from figures import impedance, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(impedance.draw_nyquist(artefact.load_some(snakemake.input)), job)
