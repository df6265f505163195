"""One test that took no part in the fit: its voltage by the model, its SoC by filters, scored."""

import cellwright as cw
from runtime import artefact, job_inputs

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake, *output) as job:
    about = job.load(inputs.model), job.load(inputs.series), *job_inputs.facts_of_job(snakemake)
    record = cw.held_out(*about, split_rest_second=params.split_rest_second)
    with artefact.Job(snakemake, output.scores, output.simulation) as job:
        found = cw.validate(*record, repeats=artefact.load_first(inputs.repeats))
        job.note(*found.notes)
        job.save(found.rows, output.scores)
        job.save(found.series, output.simulation)
    with artefact.Job(snakemake, output.soc, output.soc_series) as job:
        found = cw.estimate_soc(*record, params.soc)
        job.note(*found.notes)
        job.save(found.rows, output.soc)
        job.save(found.series, output.soc_series)
