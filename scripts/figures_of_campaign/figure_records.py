"""Figure: the records of one cell, coloured by step."""

from figures import campaign, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.series, snakemake.input.steps, strict=True)
    records = artefact.load_together(pairs)
    style.save(campaign.draw_records(records, snakemake.params.total), job)
