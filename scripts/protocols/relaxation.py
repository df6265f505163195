"""Depolarisation in the rests of one test: two exponentials each, or why not."""

from cellwright.protocols.rests import chamber_or_cell, example, rests_of
from cellwright.records.basis import soc_or_unknown
from cellwright.series.steps import Steps
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    series, basis = job.load(snakemake.input.series), job.load(snakemake.input.basis)
    anchored = soc_or_unknown(series, basis, *facts.of_job(snakemake))
    time, current, voltage = artefact.columns(series, "test_time", "current", "voltage")
    steps, settings = Steps(**job.load(snakemake.input.steps)), snakemake.params.settings
    warm = chamber_or_cell(series)
    found = rests_of(
        time, current, voltage, anchored.soc, steps, temperature_celsius=warm, **settings
    )
    job.note(*found.left_out)
    job.save(found.rows, snakemake.output.rests)
    job.save(example(found.rows, time, voltage), snakemake.output.curve)
