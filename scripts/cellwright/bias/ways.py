"""Four ways to a cell's model, side by side on tests that no fit has seen."""

from typing import NamedTuple

import numpy as np

from cellwright.bias.compared import compared
from cellwright.bias.corrected import (
    alternatives,
    corrected_model,
    reference_and_others,
    scaled_model,
    voltage_interval,
    with_given_model,
)
from cellwright.bias.correction import correction
from cellwright.bias.courses import FAST_SECOND, KNOTS, courses_of, step_ohm
from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import circuit_at, member_of, simulate_model
from cellwright.identification.validation import scores
from cellwright.numerics.statistics import rms
from cellwright.records.basis import at_cycle
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()
FEW = (0, 3, 5, 10, 20)  # cells that calibrate, drawn at random
AT_SOC = {"100": 1.0, "50": 0.5, "10": 0.1}


class Scored(NamedTuple):
    """A cell with what it is judged by: Shown with its model, the model that the pipeline uses,
    CellFacts, and MeasuredTest of roles validation or split."""

    shown: object
    own: dict
    facts: object
    tests: tuple


def compare_bias_ways(cells, *, split_rest_second=MODELS.split_rest_second):
    """Voltage errors [V] of cells by the reference's model, scaled, corrected, and their own.

    Of every cell but the reference: the reference's model as it is ("reference"), scaled by
    capacity and resistance ratio ("scaled"), corrected with this cell left out of the calibration
    ("bias"), and the cell's own model ("own"). Besides, corrected by 0, 3, 5, 10 or 20 cells drawn
    at random ("bias_of_few").

    cells : `bias.ways.Scored` of one type, each with its own model and tests not fitted to.

    Returns rows, one a cell, way and test: rmse_volt, mean_abs_volt, max_abs_volt,
    half_interval_volt [V], share_within, relative errors of resistances [1]; notes: what could not
    be compared, and why. Raises Refusal: fewer than two cells, or no test could be compared.
    Source: thesis 4.5; docs/bias.md.
    """
    cells = with_given_models(cells)
    if len(cells) < 2:
        raise Refusal(f"{len(cells)} cell(s) of this type have a model; wanted two or more")
    marked = reference_and_others(cells[0].shown, [cell.shown for cell in cells])[0]
    others = [cell for cell in cells if cell.shown is not marked]
    # No other member of it is corrected or simulated.
    chosen = [member_of(marked.model)]
    reference = marked._replace(model=marked.model | {"members": chosen})
    base = courses_of(reference.model, reference.model["chosen"])
    against = compared(reference, [cell.shown for cell in others])
    rows, notes, random = [], [], np.random.default_rng(0)
    for place, cell in enumerate(others):
        rest = [one for one in against if one is not against[place]]
        models = (against[place], base, rest)
        ways, found = _models(cell.own, reference, *models, random)
        of_cell, reasons = _scored(cell, ways, found.model_error_volt, split_rest_second)
        rows += of_cell
        notes += [f"{cell.shown.cell}: {words}" for words in found.outside] + reasons
    if not rows:
        raise Refusal(f"no test could be compared: {'; '.join(notes) or 'none was given'}")
    return Result({"rows": rows}, notes=tuple(notes))


def with_given_models(cells):
    """Scored of cells with the content of their models."""
    return [
        cell._replace(shown=with_given_model(cell.shown), own=given.model(cell.own))
        for cell in cells
    ]


def _scored(cell, ways, model_error_volt, split_rest_second):
    """Rows of all tests of a cell, and why others have none."""
    rows, reasons = [], []
    errors = _resistance_errors(cell.own, [model for _, _, model, _ in ways])
    for test in cell.tests:
        try:
            rows += _rows(cell, ways, test, errors, model_error_volt, split_rest_second)
        except Refusal as refusal:
            reasons.append(f"{cell.shown.cell}, {test.facts.test}: {refusal}")
    return rows, reasons


def _models(own, reference, cell, base, rest, random):
    """Models of a cell: (way, cells that calibrate, model, alternatives or none) each."""
    shown = cell.shown
    found = correction(cell, base, rest)
    bias = corrected_model(shown, reference, found)
    ways = [
        ("reference", 0, reference.model, ()),
        ("scaled", 0, scaled_model(shown, reference), ()),
        ("bias", len(found.cells), bias, alternatives(shown, reference, found)),
        ("own", 0, own, ()),
    ]
    for count in [count for count in FEW if count < len(rest)]:
        drawn = [rest[k] for k in random.choice(len(rest), count, replace=False)]
        of_few = corrected_model(shown, reference, correction(cell, base, drawn))
        ways.append(("bias_of_few", count, of_few, ()))
    return ways, found


def _rows(cell, ways, test, resistance_errors, model_error_volt, split_rest_second):
    rows = []
    for (way, count, model, others), errors in zip(ways, resistance_errors, strict=True):
        aged = at_cycle(model, test.facts.cycle)
        record = laid_out(test, aged, cell.facts, split_rest_second=split_rest_second, proof=True)
        columns = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
        run = simulate_model(aged, None, *columns, kind=record.kind)
        error = (record.voltage_volt - run.voltage_volt)[record.used]
        rows.append(
            {"cell": cell.shown.cell, "test": test.facts.test, "way": way}
            | {"model_of": model["cell"], "calibrating_cells": count}
            | {"ambient_temperature_celsius": test.facts.ambient_temperature_celsius}
            | scores(error, record.soc[record.used])
            | {"mean_abs_volt": float(np.abs(error).mean())}
            | _within(error, model, others, record, model_error_volt)
            | errors
        )
    return rows


def _within(error, model, others, record, model_error_volt):
    """How wide the stated interval of the voltage is, and which share of the samples it holds."""
    half = voltage_interval(model, others, record, model_error_volt=model_error_volt)[record.used]
    known = np.isfinite(half).all()
    return {
        "half_interval_volt": rms(half) if known else np.nan,
        "share_within": float(np.mean(np.abs(error) <= half)) if known else np.nan,
    }


def _resistance_errors(own, models):
    """Relative difference of R0 and of the resistance after 10 s from the cell's own model [1],
    one dict a model."""
    found = [{} for _ in models]
    for name, second in (("r0", 0.0), ("r10", FAST_SECOND)):
        true = _step(own, second)
        for errors, model in zip(found, models, strict=True):
            ratio = np.interp(list(AT_SOC.values()), KNOTS, _step(model, second) / true) - 1
            named = zip(AT_SOC, ratio.tolist(), strict=True)
            errors |= {f"{name}_error_soc_{at}": error for at, error in named}
    return found


def _step(model, second):
    sampled = circuit_at(member_of(model)["conditions"], KNOTS, REFERENCE_CELSIUS)
    parameters = [branch.parameters for branch in sampled.circuit]
    at_once = [p for p in parameters if np.max(p.get("tau_second", 0.0)) <= 1e-2]
    return step_ohm(at_once, 1.0) if second == 0 else step_ohm(parameters, second)
