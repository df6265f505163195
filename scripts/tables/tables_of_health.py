"""CSV tables of the results contract: the health of cells."""

from runtime import artefact, job_inputs

for name, path in snakemake.output.items():
    paths = snakemake.input.get(name, [])
    with artefact.Job(snakemake, path, inputs=paths) as job:
        job.save(job_inputs.rows_of(paths, snakemake.params.tests))
