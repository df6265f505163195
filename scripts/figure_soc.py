"""Figure: state of charge of one test by filters."""

import figure
from drawing import soc
from runtime import artefact

with artefact.Job(snakemake) as job:
    series = job.load(snakemake.input.series)
    scores = artefact.rows(job.load(snakemake.input.scores))
    figure.save(soc.draw(series, scores, snakemake.wildcards.test), job)
