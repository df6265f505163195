"""Cut a clean series into steps."""

from cellwright.series.steps import segment
from runtime import artefact

with artefact.Job(snakemake) as job:
    series = job.load(snakemake.input.series)
    steps = segment(
        *artefact.columns(series, "test_time", "current", "voltage", "charge"),
        file_index=series["file_index"],
        rated_capacity_ampere_hour=snakemake.params.cell["rated_capacity_ampere_hour"],
        **snakemake.params.settings,
    )
    job.save(steps)
