"""Read the files of one test: bytes to columns with units, sign and clock checked."""

from cellwright import formats, series
from runtime import artefact, raw_files

with artefact.Job(snakemake) as job:
    said = snakemake.params.reading
    readings = [
        formats.read(data, name=name, instrument=said["instrument"])
        for name, data in raw_files.contents(said["file"], said["sha256"])
    ]
    found = series.assemble(readings, stated_sign=said["current_sign"])
    job.note(*found.notes)
    job.save(found.columns, instrument=[reading.instrument for reading in readings])
