"""Read one impedance spectrum."""

import cellwright as cw
from runtime import artefact, raw_files

with artefact.Job(snakemake) as job:
    said = snakemake.params.reading
    file = raw_files.single(said["file"], said["sha256"])
    found = cw.read(file, kind="impedance", instrument=said["instrument"])
    job.save(found.columns, instrument=found.instrument[0])
