"""What the corrected model lacks of the cell that it serves worst: a search for an effect."""

import cellwright as cw
from runtime import artefact, job_inputs, type_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    split = {"split_rest_second": params.split_rest_second}
    cells = type_inputs.judged_cells(inputs, params.references, params.cells)
    worst = cw.worst_corrected(artefact.rows(job.load(inputs.ways)))
    cell, words = worst["cell"], worst["words"]
    paths = [path for path in (*inputs.fitted, *inputs.series) if f"/{cell}/" in path]
    tests, basis = job_inputs.tests(paths), job.load(f"results/stages/basis/{cell}.json")
    voltages = cw.corrected_voltages(cells, cell, tests, **split)
    about = params.cells[cell], basis, tests, params.settings
    found = cw.missing_effect(*about, simulated=voltages, **split)
    job.note(words, *found.notes)
    job.save(found.verdict | {"worst": words})
