"""Compare the temperature in a cell's spectra with that of its other records at rest."""

import artefact
from cellwright.protocols.impedance.thermometer import rested_temperature, temperature_offsets

with artefact.Job(snakemake) as job:
    spectra = artefact.load_all(snakemake.input.spectra)
    records = [
        (columns, about)
        for columns, about in artefact.load_all(snakemake.input.series)
        if "surface_temperature_celsius" in columns
    ]
    rest = snakemake.params.rest_c_rate * snakemake.params.cell["rated_capacity_ampere_hour"]
    names = ("test_time_second", "current_ampere", "surface_temperature_celsius")
    rested = [
        rested_temperature(*[c[name] for name in names], rest_ampere=rest) for c, _ in records
    ]
    found = [(one["temperature_celsius"][0], about) for one, about in spectra]
    read = [*found, *zip(rested, [about for _, about in records], strict=True)]
    pairs = [(about["params"]["test"]["ambient_temperature_celsius"], t) for t, about in read]
    rows, notes = temperature_offsets(pairs[: len(found)], pairs[len(found) :])
    job.note(*notes)
    job.save(rows)
