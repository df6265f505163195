"""List of the functional mock-up units of a campaign."""

from pathlib import Path

from runtime import artefact

with artefact.Job(snakemake) as job:
    abouts = {Path(path).stem: artefact.read_about(path) for path in snakemake.input}
    rows = [
        {"name": name, "reason": about["reason"], "notes": "; ".join(about["notes"])}
        | {key: about["facts"].get(key) for key in ("token", "platform")}
        for name, about in abouts.items()
    ]
    job.save(rows)
