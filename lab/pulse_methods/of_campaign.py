"""The pulses of a finished campaign by each identification method: a table, and a figure a cell."""

from pathlib import Path

import pandas as pd

from cellwright.refusal import Refusal
from figures import svg
from pulse_methods.figure import draw_identification_methods
from pulse_methods.of_cell import compare_identification_methods
from runtime import artefact, job_inputs, sheets
from runtime.plan import Plan

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
KINDS = ("hppc", "pulse_resistance")
RESULTS = Path("results", "methods")  # in the campaign
TABLE = "identification_methods.csv"
DIGITS = "%.9g"  # as tables of the results have them


def compare_campaign(campaign) -> list[str]:
    """Write the table and the figures into `results/methods` of a finished campaign.

    Cells with pulses that may be fitted are compared; columns are those of
    `comparison.MethodRows`, with the cell before them.

    Returns
    -------
    notes : sentences on pulses, tests and cells that were left out.

    Raises
    ------
    FileNotFoundError
        The pipeline has not run here to the capacity and OCV of a cell.
    Refusal
        No cell of the campaign has such pulses.
    """
    plan = Plan(sheets.read(campaign, SCHEMAS))
    cells = [cell for cell in plan.cells if plan.rows(cell, *KINDS, roles=["fit"])]
    if not cells:
        raise Refusal(f"{campaign}: no test of kind {' or '.join(KINDS)} with role fit")
    results = Path(campaign, RESULTS)
    results.mkdir(parents=True, exist_ok=True)
    frames, notes = [], []
    for cell in cells:
        try:
            compared = _compare_cell(Path(campaign), plan, cell)
        except Refusal as refusal:
            notes.append(f"{cell}: {refusal}")
            continue
        notes += [f"{cell}: {note}" for note in compared.notes]
        frame = compared.to_frame()
        frame.insert(0, "cell", cell)
        frames.append(frame)
        figure = draw_identification_methods(artefact.rows(compared.rows._asdict()))
        (results / f"{cell}.svg").write_text(svg.text_of(figure, description=cell), "utf-8")
    if frames:
        table = pd.concat(frames, ignore_index=True)
        table.to_csv(results / TABLE, index=False, float_format=DIGITS, lineterminator="\n")
    return notes


def _compare_cell(campaign, plan, cell):
    """Result of `compare_identification_methods` from the artefacts of a cell."""
    series, steps = (
        [campaign / path for path in plan.fitted(stage, cell, *KINDS)]
        for stage in ("clean", "segment")
    )
    basis = campaign / "results" / "stages" / "basis" / f"{cell}.json"
    if absent := [path for path in (*series, *steps, basis) if not path.is_file()]:
        raise FileNotFoundError(
            f"{absent[0]}: there is no such file, wanted a campaign that the pipeline has run: "
            f"./run snakemake --cores 2 --directory {campaign}"
        )
    tests = job_inputs.tests_with_steps(steps, series)
    return compare_identification_methods(plan.facts_of(cell), artefact.load(basis), tests)
