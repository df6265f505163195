"""Judge the answers on all parts of the zoo: page, picture, table."""

from effect_benchmark.zoo import judging, page
from figures import style
from runtime import artefact

with artefact.Job(snakemake) as job:
    out, params = snakemake.output, snakemake.params
    rows, skipped = judging.of_parts(params.folder, artefact.load_all(snakemake.input.answers))
    style.save(page.picture(rows), job, out.picture)
    job.save(judging.columns(rows), out.cells)
    page.save(rows, skipped, params.options, job, out.page)
