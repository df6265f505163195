"""How much of what is hidden in a cell by physics a plain circuit leaves, and what of it shows.

A circuit leaves millivolts of any porous-electrode cell. What it leaves of the cell is therefore
compared with what it leaves of the same cell without the effect, and, when all cells are made, with
what it leaves of the references.
"""

import numpy as np

from virtual_lab.instruments import measurement
from virtual_lab.zoo.physics_circuit import SOC, Drive, residuals_volt, rms_volt
from virtual_lab.zoo.physics_forms import FORMS

RESIDUALS = "residual"  # table of the parts, which `compared` uses up
STEP_SECOND = 1.0
KEPT_EVERY = 5
DRIVEN_STEPS = 2  # rest and load: the rest after the load begins where the load ended
FACTORS = {False: 1.15, True: 1.3}  # by whether a drive is proof
MICROVOLT = 1e-6


def row(zoo_cell) -> dict:
    """Row of missing_effect.json, without what follows from all cells together.

    Parameters
    ----------
    zoo_cell : physics_cells.ZooCell.
    """
    equations = zoo_cell.setup(zoo_cell.tasks[-1]).cell.equations
    chain = zoo_cell.setup(zoo_cell.tasks[0], healthy=True).chain
    floor = float(np.hypot(chain.voltage_noise_volt, chain.voltage_slow_noise_volt))
    return {
        "cell": zoo_cell.name,
        "kind": zoo_cell.kind,
        "zoo": "physics",
        "type": zoo_cell.type,
        "equations": equations,
        "proof_celsius": list(zoo_cell.proof_celsius),
        "floor_volt": round(floor, 6),
        "effects": [_effect(zoo_cell)] if zoo_cell.form else [],
    }


def _effect(zoo_cell):
    form = FORMS[zoo_cell.form]
    return {
        "effect": form.effect,
        "form": zoo_cell.form,
        "parameters": {form.parameter: zoo_cell.size},
        "accept": zoo_cell.names,
    }


def residual_rows(zoo_cell) -> list[dict]:
    """What a plain circuit leaves of each drive [µV], with and without what is hidden.

    Parameters
    ----------
    zoo_cell : physics_cells.ZooCell.

    Returns
    -------
    Rows with cell, test, proof, `without` and `with`, every fifth second and None where the cell
    is nearly empty; of healthy cells both are the same.
    """
    without = _residuals(zoo_cell, healthy=True)
    with_it = _residuals(zoo_cell, healthy=False) if zoo_cell.form else without
    return [
        {
            "cell": zoo_cell.name,
            "test": task.test,
            "proof": task.role == "validation",
            "without": _stored(without[task.test]),
            "with": _stored(with_it[task.test]),
        }
        for task in _drives(zoo_cell)
    ]


def _drives(zoo_cell):
    return [task for task in zoo_cell.tasks if task.is_drive]


def _residuals(zoo_cell, *, healthy):
    """What the plain circuit leaves of each drive [V], by test."""
    from virtual_lab.physics import porous

    mine = zoo_cell.setup(zoo_cell.tasks[0], healthy=True).cell
    drives = [_shown(zoo_cell, task, healthy=healthy) for task in _drives(zoo_cell)]
    left = residuals_volt(
        drives,
        porous.rested_volt(mine, SOC),
        capacity_ampere_hour=porous.full_charge_ampere_hour(mine),
    )
    return {task.test: volt for task, volt in zip(_drives(zoo_cell), left, strict=True)}


def _shown(zoo_cell, task, *, healthy) -> Drive:
    """A drive as the channel shows it, without noise, up to the end of its load."""
    behaviours = zoo_cell.behaviours(task, healthy=healthy)[:DRIVEN_STEPS]
    chain = zoo_cell.setup(task, healthy=healthy).chain
    durations = np.array([one.duration_second for one in behaviours])
    second = np.arange(0.0, durations.sum(), STEP_SECOND)
    current = measurement.reading([one.current for one in behaviours], durations, second)
    volt = measurement.reading(
        [one.voltage for one in behaviours],
        durations,
        second,
        delay_second=chain.voltage_delay_second,
    )
    return Drive(
        current + chain.current_offset_ampere, volt, STEP_SECOND, task.role == "validation"
    )


def _stored(volt):
    kept = np.round(volt[::KEPT_EVERY] / MICROVOLT)
    return [None if np.isnan(one) else int(one) for one in kept]


def compared(tables: dict[str, list[dict]]) -> dict[str, list[dict]]:
    """Truth tables of all cells, with the strength and visibility of what is hidden.

    Parameters
    ----------
    tables : with rows of `row` and of `residual_rows`; the latter are used up.
    """
    residuals: dict[str, list[dict]] = {}
    for one in tables.pop(RESIDUALS):
        residuals.setdefault(one["cell"], []).append(one)
    rows = tables["missing_effect"]
    references: dict[str, list[dict]] = {}
    for one in rows:
        if one["kind"] == "reference":
            references.setdefault(one["type"], []).extend(residuals[one["cell"]])
    complete = [_complete(one, residuals[one["cell"]], references[one["type"]]) for one in rows]
    return tables | {"missing_effect": complete}


def _complete(row_of_cell, residuals, references):
    """A row with its gaps and what is visible of them."""
    others = [one for one in references if one["cell"] != row_of_cell["cell"]]
    parts = {
        proof: [_beside(one, others) for one in residuals if one["proof"] == proof]
        for proof in (False, True)
    }
    gaps = {p: rms_volt([with_it - base for with_it, base, _ in parts[p]]) for p in parts}
    noise = row_of_cell["floor_volt"]
    without = {p: rms_volt([base for _, base, _ in parts[p]]) for p in parts}
    beside = {p: rms_volt([base - mean for _, base, mean in parts[p]]) for p in parts}
    seen = {p: _is_visible(gaps[p], beside[p], noise, FACTORS[p]) for p in parts}
    alone = any(_is_visible(gaps[p], without[p], noise, FACTORS[p]) for p in parts)
    hidden = bool(row_of_cell["effects"])
    visible = hidden and any(seen.values())
    sheet = row_of_cell["kind"] == "sheet"
    told = {
        "visible_gap_millivolt": round(1e3 * gaps[False], 3),
        "validation_gap_millivolt": round(1e3 * gaps[True], 3),
    }
    return row_of_cell | {
        "visible": visible,
        "visible_alone": hidden and alone,
        "unproven": visible and not seen[True],
        "none_acceptable": not visible or sheet,
        "base_volt": round(without[True], 6),
        "beside_references_volt": round(beside[True], 6),
        "effects": [effect | told for effect in row_of_cell["effects"]],
    }


def _beside(mine, references):
    """With and without the effect, and the mean of the references [V], on what all have."""
    same = [one["without"] for one in references if one["test"] == mine["test"]]
    every = [mine["with"], mine["without"], *same]
    shared = min(map(len, every))
    with_it, without, *others = (
        MICROVOLT * np.array(one[:shared], float) for one in every
    )  # None becomes NaN
    return with_it, without, np.mean(others, axis=0)


def _is_visible(gap_volt, rest_volt, noise_volt, factor):
    """Whether gap, rest and noise together exceed a factor times rest and noise."""
    rest = np.hypot(rest_volt, noise_volt)
    return bool(np.hypot(gap_volt, rest) > factor * rest)
