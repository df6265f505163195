"""Read one spectrum, fit a circuit to it, test the spectrum itself, find its relaxation times."""

import cellwright as cw
from runtime import artefact, raw_files, time_limit

params, output = snakemake.params, snakemake.output
with artefact.Job(snakemake, output.spectrum) as reading:
    said, largest = params.reading, params.largest_megabyte
    file = raw_files.single(said["file"], said["sha256"], largest, params.content)
    how = {"kind": "impedance", "instrument": said["instrument"], "columns": said["columns"]}
    with time_limit.within(params.longest_minute, said["file"]):
        read = cw.read(file, **how, largest_megabyte=largest)
    reading.note(*read.notes)
    reading.save(read.columns, instrument=read.instrument[0])
with artefact.Job(snakemake, *output[1:], after=reading) as job:
    spectrum = job.load(output.spectrum)
    found = cw.impedance(spectrum, params.settings, cell=params.cell, doubt=read.doubt)
    job.note(*found.notes)
    job.save(found.rows, output.fit)
    job.save(found.curve, output.curve)
    job.save(found.parameters, output.parameters)
    job.save(found.candidates, output.candidates)
    job.save(found.distribution, output.distribution)
    job.save(found.processes, output.processes)
