"""Figure: open-circuit voltage of one cell over temperature."""

import figure
from drawing import ocv_temperature
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    parts = [job.load(path) for path in (inputs.map, inputs.entropic, inputs.surface)]
    functions = artefact.rows(job.load(inputs.functions))
    figure.save(ocv_temperature.draw(*parts, functions), job)
