"""Figure: four ways to the models of the cells of each type."""

from figures import bias, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    loaded = artefact.load_some(snakemake.input)
    names = snakemake.params.types
    types = [(names[about["wildcards"]["cell"]], artefact.rows(rows)) for rows, about in loaded]
    style.save(bias.draw_bias(types), job)
