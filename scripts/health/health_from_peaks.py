"""State of health of one cell from peaks of dQ/dV: its rows of the calibration of its type."""

from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    columns = job.load(snakemake.input.calibration)
    rows = job_inputs.rows_of_cell(columns, snakemake.wildcards.cell)
    job.save(rows)
