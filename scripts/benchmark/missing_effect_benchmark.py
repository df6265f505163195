"""Set the answers of the benchmark beside what was hidden: page, figures, tables."""

from effect_benchmark import page, pictures, scoring
from figures import style
from runtime import artefact

with artefact.Job(snakemake) as job:
    out, params = snakemake.output, snakemake.params
    batches = artefact.load_all(snakemake.input.answers)
    answers = [row for columns, _ in batches for row in artefact.rows(columns)]
    table = scoring.judged(params.folder, answers)
    style.save(pictures.confusion(table), job, out.confusion)
    style.save(pictures.power(table), job, out.power)
    job.save(scoring.flat(table), out.cells)
    job.save(scoring.goal_rows(table), out.goals)
    page.save(table, params.options, job, out.page)
