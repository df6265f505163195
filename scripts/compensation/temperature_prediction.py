"""Tests for validation at a temperature, predicted by a model that does not know it."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    models = (job.load(inputs.whole), job_inputs.models_without(inputs.left_out))
    about = (params.cell, *models, job_inputs.tests(inputs.series))
    found = cw.predict_left_out(*about, split_rest_second=params.split_rest_second)
    job.note(*found.notes)
    job.save(found.rows)
