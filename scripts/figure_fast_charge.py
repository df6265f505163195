"""Figure: fast charges of one cell by temperature."""

import figure
from drawing import fast_charge
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    found = [
        (job.load(series), job.load(steps), *pair)
        for series, steps, path in zip(inputs.series, inputs.steps, inputs.numbers, strict=True)
        for pair in artefact.load_all([path])
    ]
    if not found:
        job.load(inputs.numbers[0])
    figure.save(fast_charge.draw(found), job)
