"""Models of a group's cells from the group's own branch currents."""

import artefact
from cellwright.models.group_models import group_models

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
