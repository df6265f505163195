"""Models of a group's cells from the group's own branch currents."""

from cellwright.packs.group import group_models
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.series, snakemake.input.steps, strict=True)
    series, steps, about = artefact.load_together(pairs)[0]
    models = group_models(
        series,
        steps,
        [row["cell"] for row in snakemake.params.branches],
        test=about["wildcards"]["test"],
        celsius=about["params"]["test"]["ambient_temperature_celsius"],
    )
    job.save({"group": snakemake.wildcards.group, "models": models})
