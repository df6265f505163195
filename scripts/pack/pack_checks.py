"""Hold a group's record against itself and against its wiring."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    record = job.load(snakemake.input.series)
    test = snakemake.params.test | {"test": snakemake.wildcards.test}
    simulated = artefact.load_first(snakemake.input.simulated)
    found = cw.check_group(snakemake.params.branches, record, test, simulated)
    job.note(*found.notes)
    job.save(found.rows)
