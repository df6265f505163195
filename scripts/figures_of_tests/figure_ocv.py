"""Figure: open-circuit voltage of one cell."""

from figures import ocv, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(ocv.draw_ocv(artefact.load_some(snakemake.input)), job)
