"""Figure: resistance against capacity over the cells of each type."""

from figures import health, style
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    frames = (tables.load_frame(path) for path in snakemake.input)
    rows, lines = (frame.to_dict("records") for frame in frames)
    style.save(health.draw_fleet(rows, lines), job)
