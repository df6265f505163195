"""What limits one cell in the cold, in words."""

from cellwright.laws.cold import cold_limit
from cellwright.laws.points import Point
from runtime import artefact

with artefact.Job(snakemake) as job:
    points = [Point(**row) for row in artefact.rows(job.load(snakemake.input.points))]
    laws = artefact.rows(job.load(snakemake.input.laws))
    job.save(cold_limit(points, laws))
