"""Complete cycles of one ageing record: capacity, energy, efficiency, temperature."""

from cellwright.protocols.ageing import ageing_cycles
from cellwright.series.steps import Steps
from runtime import artefact

with artefact.Job(snakemake) as job:
    cell = {k: v for k, v in snakemake.params.cell.items() if k != "cell"}
    found = ageing_cycles(
        job.load(snakemake.input.series),
        Steps(**job.load(snakemake.input.steps)),
        first_cycle=snakemake.params.test["cycle"] or 0.0,
        **cell,
    )
    job.note(*found.left_out)
    job.save(found.rows)
