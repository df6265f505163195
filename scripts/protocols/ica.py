"""Incremental capacity of the constant-current charge in one test, and its peaks."""

from cellwright.protocols.ica import charge_peaks, constant_current_charge, incremental_capacity
from runtime import artefact

with artefact.Job(snakemake) as job:
    series, settings = job.load(snakemake.input.series), snakemake.params.settings
    steps = job.load(snakemake.input.steps)
    first, last, step = constant_current_charge(steps, series["charge_ampere_hour"])
    voltage, charge = artefact.columns(series, "voltage", "charge")
    curve = incremental_capacity(
        voltage[first : last + 1],
        charge[first : last + 1],
        bin_volt=settings["bin_volt"],
        smooth_volt=settings["smooth_volt"],
    )
    arrays, facts = artefact.split(curve)
    job.save(arrays, snakemake.output.curve, **facts)
    found = charge_peaks(curve, c_rate=steps["c_rate"][step], prominence=settings["prominence"])
    job.save(found, snakemake.output.peaks)
