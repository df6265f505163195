"""Read the files of one test, flag and repair what is corrupt in its series, cut it into steps."""

import cellwright as cw
from runtime import artefact, raw_files, time_limit

params, output = snakemake.params, snakemake.output
with artefact.Job(snakemake, output.ingest) as reading:
    said, largest = params.reading, params.largest_megabyte
    files = raw_files.contents(said["file"], said["sha256"], largest, params.content)
    how = {name: said[name] for name in ("instrument", "current_sign", "columns")}
    with time_limit.within(params.longest_minute, said["file"]):
        found = cw.read(files, **how, **params.channels, largest_megabyte=largest)
    reading.note(*found.notes)
    reading.save(found.columns, instrument=found.instrument)
with artefact.Job(snakemake, output.clean, output.flags, after=reading) as cleaning:
    # A group has another rating and other cut-offs than its first cell, whose facts it is given.
    cell = None if params.channels else params.cell
    series = cleaning.load(output.ingest)
    with time_limit.within(params.longest_minute, params.reading["file"]):
        found = cw.clean(series, params.clean, cell=cell, test=params.test)
    cleaning.note(*found.notes)
    cleaning.save(found.columns, output.clean)
    cleaning.save(found.actions, output.flags)
with artefact.Job(snakemake, output.segment, after=cleaning) as cutting:
    cutting.save(cw.segment(cutting.load(output.clean), params.cell, params.segment).rows)
