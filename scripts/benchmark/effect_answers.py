"""Search one batch of the benchmark's cells, and try the controls on them."""

from effect_benchmark.answers import answered, task
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    left_out = job.load(snakemake.input.left_out)["cells"]
    work = task(params.folder, left_out, params.settings)
    job.save(answered(work, int(snakemake.wildcards.batch), params.batches))
