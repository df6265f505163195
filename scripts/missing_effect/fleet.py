"""Table of cells of each type and their effects: what all share, and what one has alone."""

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    verdicts = [verdict for verdict, _ in artefact.load_all(snakemake.input.verdicts)]
    witnesses = tables.rows_of(snakemake.input.witnesses, {})
    job.save(tables.fleet_rows(verdicts, snakemake.params.types, witnesses), snakemake.output.table)
