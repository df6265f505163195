"""Figure: the campaign at a glance."""

from figures import campaign, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    tables = [artefact.load_table(path) for path in snakemake.input]
    style.save(campaign.draw_overview(snakemake.params.cells, *tables), job)
