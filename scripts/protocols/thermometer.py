"""Compare the temperature in a cell's spectra with that of its other records at rest."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    spectra = artefact.load_all(snakemake.input.spectra)
    records = artefact.load_all(snakemake.input.series)
    found = cw.thermometer(
        [(about["params"]["test"], artefact.rows(fit)[0]) for fit, about in spectra],
        [(about["params"]["test"], series) for series, about in records],
    )
    job.note(*found.notes)
    job.save(found.rows)
