"""Compare the temperature in a cell's spectra with that of its other records at rest."""

from cellwright.protocols.impedance.trust import rested_temperature, temperature_offsets
from runtime import artefact

with artefact.Job(snakemake) as job:
    spectra = artefact.load_all(snakemake.input.spectra)
    records = artefact.load_all(snakemake.input.series)
    names = ("test_time_second", "current_ampere", "surface_temperature_celsius")
    series = [[columns.get(name) for name in names] for columns, _ in records]
    read = [columns["temperature_celsius"][0] for columns, _ in spectra]
    read += [rested_temperature(*one) for one in series]
    tests = [about["params"]["test"] for _, about in spectra + records]
    pairs = [(test["ambient_temperature_celsius"], t) for test, t in zip(tests, read, strict=True)]
    rows, notes = temperature_offsets(pairs[: len(spectra)], pairs[len(spectra) :])
    job.note(*notes)
    job.save(rows)
