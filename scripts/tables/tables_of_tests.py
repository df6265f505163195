"""CSV tables of the results contract: what tests tell."""

import cellwright as cw
from runtime import artefact, job_inputs

for name, path in snakemake.output.items():
    paths = snakemake.input.get(name, [])
    with artefact.Job(snakemake, path, inputs=paths) as job:
        rows = job_inputs.rows_of(paths, snakemake.params.tests)
        if name in ("capacity", "resistance"):
            rows = cw.disagreements(rows, quantity=name).rows
        job.save(rows)
