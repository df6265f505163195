"""Fitted tests at a temperature, predicted by a model that does not know it."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    reduced = job_inputs.models_without(inputs.left_out)
    about = (params.cell, job.load(inputs.whole), reduced, job_inputs.tests(inputs.series))
    settings = {"split_rest_second": params.split_rest_second}
    found = cw.predict_left_out(*about, validation=False, **settings)
    job.note(*found.notes)
    job.save(found.rows)
