"""Figure: open-circuit voltage of one cell over temperature."""

from figures import ocv, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    parts = [job.load(path) for path in (inputs.map, inputs.entropic, inputs.surface)]
    functions = artefact.rows(job.load(inputs.functions))
    style.save(ocv.draw_ocv_temperature(*parts, functions), job)
