"""Models of a group's cells from the group's own branch currents."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    pairs = zip(snakemake.input.series, snakemake.input.steps, strict=True)
    series, steps, about = artefact.load_together(pairs)[0]
    test = about["params"]["test"] | {"test": about["wildcards"]["test"]}
    cells = [row["cell"] for row in snakemake.params.branches]
    found = cw.identify_branches(series, steps, cells, test)
    job.save({"group": snakemake.wildcards.group} | found.content)
