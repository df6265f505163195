"""Capacities of the complete charges and discharges of one test."""

from cellwright.protocols.capacity import capacity
from cellwright.series.steps import Steps
from runtime import artefact

with artefact.Job(snakemake) as job:
    series, cell = job.load(snakemake.input.series), snakemake.params.cell
    found = capacity(
        *artefact.columns(series, "test_time", "current", "voltage", "charge"),
        Steps(**job.load(snakemake.input.steps)),
        rated_capacity_ampere_hour=cell["rated_capacity_ampere_hour"],
        lower_cutoff_volt=cell["lower_cutoff_volt"],
        upper_cutoff_volt=cell["upper_cutoff_volt"],
        surface_temperature_celsius=series.get("surface_temperature_celsius"),
        whole_swing=snakemake.params.test["kind"] == "ocv",
    )
    job.note(*found.left_out)
    job.save(found.rows)
