"""How much a fast charge puts in, and what limits it."""

from cellwright.protocols.fast_charge import fast_charge
from cellwright.series.steps import Steps
from runtime import artefact

with artefact.Job(snakemake) as job:
    cell = {k: v for k, v in snakemake.params.cell.items() if k != "cell"}
    found, notes = fast_charge(
        job.load(snakemake.input.series),
        Steps(**job.load(snakemake.input.steps)),
        capacity_ampere_hour=job.load(snakemake.input.basis)["capacity_ampere_hour"],
        **cell,
        **snakemake.params.settings,
    )
    job.note(*notes)
    job.save([found])
