"""Figure: the campaign at a glance."""

import figure
from drawing import overview
from runtime import artefact

with artefact.Job(snakemake) as job:
    tables = [artefact.load_table(path) for path in snakemake.input]
    figure.save(overview.draw(snakemake.params.cells, *tables), job)
