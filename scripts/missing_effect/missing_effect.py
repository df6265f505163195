"""Table of all verdicts: what the models of the campaign's cells lack."""

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    found = [verdict for verdict, _ in artefact.load_all(snakemake.input)]
    job.save(tables.verdicts(found), snakemake.output.table)
