"""One row per cell: results/summary.csv."""

from pathlib import Path

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    found = {Path(path).stem: tables.load_frame(path) for path in snakemake.input.tables}
    models = {
        Path(path).stem: model
        for path in snakemake.input.models
        for model, _ in artefact.load_all([path])
    }
    job.save(tables.summary(snakemake.params.cells, found, models))
