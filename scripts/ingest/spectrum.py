"""Read one impedance spectrum."""

from cellwright import formats
from runtime import artefact, raw_files

with artefact.Job(snakemake) as job:
    said = snakemake.params.reading
    name, data = raw_files.single(said["file"], said["sha256"])
    reading = formats.read(data, name=name, instrument=said["instrument"])
    job.save(reading.columns, instrument=reading.instrument)
