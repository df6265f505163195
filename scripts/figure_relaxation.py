"""Figure: one rest of each test with its fit and what that leaves."""

import figure
from drawing import relaxation
from runtime import artefact

with artefact.Job(snakemake) as job:
    figure.save(relaxation.draw(artefact.load_all(snakemake.input)), job)
