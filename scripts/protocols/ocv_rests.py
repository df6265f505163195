"""Open-circuit voltage of a cell without a slow test, from the rests of a pulse test."""

from cellwright.protocols.ocv.rests import ocv_of_rests, soc_at
from cellwright.protocols.rests import rest_points
from cellwright.records.anchor import rest_scale
from cellwright.series.steps import Steps
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    series, steps = job.load(snakemake.input.series), Steps(**job.load(snakemake.input.steps))
    columns = artefact.columns(series, "test_time", "current", "voltage", "charge")
    cell, known = lending.limits(snakemake.params), lending.capacities(snakemake.input.capacity)
    scale = rest_scale(*columns[1:], steps, known, **cell)
    points = rest_points(*columns, steps, rest_second=snakemake.params.rest_second)
    curve = ocv_of_rests(points, scale, **{k: v for k, v in cell.items() if "cutoff" in k})
    job.note(curve.note)
    arrays, facts = artefact.split(curve)
    job.save(arrays, snakemake.output.curve, capacity_source=scale.source, **facts)
    job.save(points._asdict() | {"soc": soc_at(points, scale)}, snakemake.output.points)
