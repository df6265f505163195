"""Four ways to the model of each cell of a type, side by side on tests that no fit has seen."""

import cellwright as cw
from runtime import artefact, type_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    cells = type_inputs.judged_cells(inputs, params.references, params.cells)
    found = cw.compare_bias_ways(cells, split_rest_second=params.split_rest_second)
    job.note(*found.notes)
    job.save(found.rows)
