"""Read one spectrum."""

import cellwright as cw
from runtime import artefact, raw_files, time_limit

with artefact.Job(snakemake) as job:
    params = snakemake.params
    said, largest = params.reading, params.largest_megabyte
    file = raw_files.single(said["file"], said["sha256"], largest, params.content)
    how = {"kind": "impedance", "instrument": said["instrument"], "columns": said["columns"]}
    with time_limit.within(params.longest_minute, said["file"]):
        read = cw.read(file, **how, largest_megabyte=largest)
    job.note(*read.notes)
    job.save(read.columns, instrument=read.instrument[0], doubt=read.doubt)
