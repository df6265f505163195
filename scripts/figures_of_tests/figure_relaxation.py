"""Figure: one rest of each test with its fit and what that leaves."""

from figures import relaxation, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    style.save(relaxation.draw_relaxation(artefact.load_all(snakemake.input)), job)
