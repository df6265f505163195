"""What limits one cell in the cold, in words."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    laws, points = job.load(snakemake.input.laws), job.load(snakemake.input.points)
    job.save(cw.cold_limit(laws, points).content)
