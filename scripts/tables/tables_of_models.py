"""CSV tables of the results contract: models and their errors."""

from runtime import artefact, job_inputs

OF_ONE_MODEL = ("models", "models_of_checkups", "validation")  # many rows of each

for name, path in snakemake.output.items():
    paths = snakemake.input.get(name, [])
    with artefact.Job(snakemake, path, inputs=paths) as job:
        job.save(job_inputs.rows_of(paths, snakemake.params.tests, of_models=name in OF_ONE_MODEL))
