"""Why a cell has no model, for the list of what was left out."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake):
    params = snakemake.params
    cw.refuse_model(params.tests, lent_curve=params.lent_curve)
