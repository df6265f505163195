"""Peaks of incremental capacity of one cell, matched across temperatures."""

from cellwright.laws.peaks import Charge, peaks_over_temperature
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.curves, snakemake.input.peaks, strict=True)
    facts, names = snakemake.params.tests, ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    charges = [
        Charge(test, facts[test], peaks["c_rate"][0], *[curve[name] for name in names])
        for curve, peaks, about in artefact.load_together(pairs)
        for test in [about["wildcards"]["test"]]
    ]
    found = peaks_over_temperature(charges, **snakemake.params.settings)
    job.note(*found.notes)
    job.save(found.matches, snakemake.output.matches)
    job.save(found.peaks, snakemake.output.peaks)
    job.save(found.curves, snakemake.output.curves)
