"""Resistance at stated delays into each pulse of one test."""

from cellwright.protocols.resistance import pulse_resistance
from cellwright.records.basis import soc_or_unknown
from cellwright.series.steps import Steps
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    series, basis = job.load(snakemake.input.series), job.load(snakemake.input.basis)
    anchored = soc_or_unknown(series, basis, *facts.of_job(snakemake))
    job.note(f"SoC: {anchored.anchor}")
    found = pulse_resistance(
        *artefact.columns(series, "test_time", "current", "voltage"),
        anchored.soc,
        Steps(**job.load(snakemake.input.steps)),
        rated_capacity_ampere_hour=basis["capacity_ampere_hour"],
        **snakemake.params.settings,
    )
    job.note(*found.left_out)
    job.save(found.rows)
