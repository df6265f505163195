"""Read one impedance spectrum."""

import artefact
import raw_files
from cellwright import formats

with artefact.Job(snakemake) as job:
    said = snakemake.params.reading
    name, data = raw_files.single(said["file"], said["sha256"])
    reading = formats.read(data, name=name, instrument=said["instrument"])
    job.save(reading.columns, instrument=reading.instrument)
