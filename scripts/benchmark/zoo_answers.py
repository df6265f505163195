"""Search one batch of the cells of one part of the zoo."""

from effect_benchmark.zoo import searching
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    number = int(snakemake.wildcards.batch)
    job.save(searching.part_batch(params.folder, number, params.batches, params.settings))
