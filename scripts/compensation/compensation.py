"""Which law over temperature predicts best the temperatures that were left out of the fit."""

from cellwright.identification.compensation import choose_laws, laws_beyond, predicted
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    tests = facts.tests(snakemake.input.series)
    left_out = artefact.load_all(snakemake.input.left_out)
    reduced = {float(about["wildcards"]["celsius"]): model for model, about in left_out}
    whole, params = job.load(snakemake.input.whole), snakemake.params
    settings = {"split_rest_second": params.split_rest_second}
    rows, notes = predicted(whole, reduced, CellFacts(**params.cell), tests, **settings)
    offered, refused = laws_beyond(whole)
    choice = choose_laws(rows, beyond=offered)
    job.note(choice.words, *filter(None, [refused]), *notes)
    job.save([row | {"chosen": row["law"] == choice.laws[row["beyond"]]} for row in rows])
