"""Read the files of one test: bytes to columns with units, sign and clock checked."""

import cellwright as cw
from runtime import artefact, raw_files

with artefact.Job(snakemake) as job:
    said = snakemake.params.reading
    files = raw_files.contents(said["file"], said["sha256"])
    found = cw.read(files, instrument=said["instrument"], current_sign=said["current_sign"])
    job.note(*found.notes)
    job.save(found.columns, instrument=found.instrument)
