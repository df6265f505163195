"""Table of all verdicts: what the models of the campaign's cells lack."""

from runtime import artefact, job_inputs, tables

with artefact.Job(snakemake) as job:
    found = [verdict for verdict, _ in artefact.load_all(snakemake.input.verdicts)]
    witnesses = job_inputs.rows_of(snakemake.input.witnesses, {})
    own, external = (
        {verdict["cell"]: verdict for verdict, _ in artefact.load_all(paths)}
        for paths in (snakemake.input.own, snakemake.input.external)
    )
    job.save(tables.verdicts(found, witnesses, own, external), snakemake.output.table)
