"""Which law over temperature predicts best the temperatures that were left out of the fit."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    reduced = job_inputs.models_without(inputs.left_out)
    about = (params.cell, job.load(inputs.whole), reduced, job_inputs.tests(inputs.series))
    found = cw.compare_temperature_laws(*about, split_rest_second=params.split_rest_second)
    job.note(*found.notes)
    job.save(found.rows)
