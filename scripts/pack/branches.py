"""Models of a group's cells from the group's own branch currents."""

from cellwright.packs.group import group_models
from cellwright.records.facts import MeasuredTest
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.series, snakemake.input.steps, strict=True)
    series, steps, about = artefact.load_together(pairs)[0]
    cells = [row.cell for row in facts.branches(snakemake.params.branches)]
    models = group_models(MeasuredTest(facts.of_artefact(about), series), steps, cells)
    job.save({"group": snakemake.wildcards.group, "models": models})
