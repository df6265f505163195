"""Figure: state of health over the lives of all cells, ageing protocols side by side."""

from figures import degradation, style
from runtime import artefact, health_page, tables

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    frames = (tables.load_frame(path) for path in (inputs.health, inputs.fade))
    found = health_page.lives(*frames, inputs.courses, snakemake.params.protocols)
    style.save(degradation.draw_lives(found), job)
