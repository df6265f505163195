"""Figures: what the model of one cell lacks, and how one can see it."""

from figures import effects, style
from runtime import artefact

with artefact.Job(snakemake) as job:
    parts = {name: job.load(path) for name, path in snakemake.input.items()}
    out = snakemake.output
    tests = effects.draw_effect_validation(parts["verdict"], parts["series"])
    style.save(tests, job, out.validation)
    style.save(effects.draw_residual_map(parts["map"]), job, out.map)
    style.save(effects.draw_evidence(parts["evidence"]), job, out.evidence)
    ranking = effects.draw_ranking(parts["ranking"], snakemake.params.gates)
    style.save(ranking, job, out.ranking)
    style.save(effects.draw_confounding(parts["confounding"]), job, out.confounding)
