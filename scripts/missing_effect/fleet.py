"""Table of cells of each type and their effects: what all share, and what one has alone."""

from runtime import artefact, job_inputs, tables

with artefact.Job(snakemake) as job:
    verdicts = [verdict for verdict, _ in artefact.load_all(snakemake.input.verdicts)]
    witnesses = job_inputs.rows_of(snakemake.input.witnesses, {})
    job.save(tables.fleet_rows(verdicts, snakemake.params.types, witnesses), snakemake.output.table)
