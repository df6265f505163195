"""Shift of the open-circuit voltage in rests of one test in a chamber that steps."""

from cellwright.protocols.ocv.steps import cell_temperature, chamber_shifts
from cellwright.records.basis import soc_or_unknown
from cellwright.series.steps import Steps
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    series, basis = job.load(snakemake.input.series), job.load(snakemake.input.basis)
    anchored = soc_or_unknown(series, basis, *facts.of_job(snakemake))
    job.note(f"SoC: {anchored.anchor}")
    found = chamber_shifts(
        *artefact.columns(series, "test_time", "voltage"),
        cell_temperature(series),
        anchored.soc,
        Steps(**job.load(snakemake.input.steps)),
        **snakemake.params.settings,
    )
    job.note(*found.left_out)
    job.save(found.rows)
