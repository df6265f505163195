"""Open-circuit voltage of one slow test, as table and as analytic functions."""

from cellwright.protocols.ocv.functions import fit_functions
from cellwright.protocols.ocv.slow import slow_ocv
from runtime import artefact, lean

with artefact.Job(snakemake) as job:
    series, cell = job.load(snakemake.input.series), snakemake.params.cell
    curve = slow_ocv(
        *artefact.columns(series, "test_time", "current", "voltage", "charge"),
        file_index=series["file_index"],
        lower_cutoff_volt=cell["lower_cutoff_volt"],
        upper_cutoff_volt=cell["upper_cutoff_volt"],
        **snakemake.params.settings,
    )
    job.note(*filter(None, [curve.note]))
    arrays, facts = artefact.split(curve)
    job.save(arrays, snakemake.output.curve, **facts)
    lean.import_lmfit()
    job.save(fit_functions(curve.soc, curve.ocv_volt), snakemake.output.functions)
