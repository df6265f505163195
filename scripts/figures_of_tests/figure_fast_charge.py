"""Figure: fast charges of one cell by temperature."""

from figures import ageing, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    charges = [
        (job.load(series), job.load(steps), *pair)
        for series, steps, path in zip(inputs.series, inputs.steps, inputs.numbers, strict=True)
        for pair in artefact.load_all([path])
    ]
    if not charges:
        job.load(inputs.numbers[0])
    style.save(ageing.draw_fast_charge(charges), job)
