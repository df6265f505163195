"""A string of cells in series: simulated from its cells' models, held against its record."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS
from cellwright.circuits.model_file import simulate_model
from cellwright.numerics.clock import checked_columns
from cellwright.numerics.lags import mean_over_steps
from cellwright.numerics.statistics import rms
from cellwright.packs.checks import beyond_calibration, swapped
from cellwright.packs.compare import discharging, refuse_start_under_load, rested_soc, scores
from cellwright.refusal import Refusal


class StringRun(NamedTuple):
    """A simulated string: voltage [V] and state of charge [1] of each cell, (n, cells) each.

    extrapolated : (n, cells) bool, outside the SoC or temperature that the cell's model has seen.
    """

    cell_voltage_volt: np.ndarray
    soc: np.ndarray
    extrapolated: np.ndarray


def simulate_string(
    models, test_time_second, current_ampere, *, initial_soc, temperature_celsius=25.0, hold=None
):
    """Voltage and SoC of cells in series: one current, each cell by its own model: StringRun.

    Every cell runs as its chosen member, whatever it is made of; nothing couples the cells but
    the current, so that no approximation enters.

    Parameters
    ----------
    models : model dicts, in the order of the string.
    test_time_second, current_ampere : (n,) [s], [A], positive on charge.
    initial_soc : scalar or (cells,) [1].
    temperature_celsius : scalar, (n,) or (n, cells) [degC].
    hold : of the current between samples, as in `model_file.simulate_model`.

    Raises
    ------
    Refusal : no model, the clock runs back, a current is not finite, or as `simulate_model`.
    """
    if not models:
        raise Refusal("a string without models cannot be simulated")
    time, current = checked_columns({"time": test_time_second, "current": current_ampere})
    shape = (len(time), len(models))
    moved = mean_over_steps(current, hold) * np.diff(time)
    charge = np.append(0.0, np.cumsum(moved)) / 3600.0
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    soc = np.broadcast_to(np.asarray(initial_soc, float), shape[1:]) + charge[:, None] / capacity
    celsius = np.asarray(temperature_celsius, float)
    celsius = np.broadcast_to(celsius[:, None] if celsius.ndim == 1 else celsius, shape)
    voltage, outside = np.empty(shape), np.empty(shape, bool)
    for k, model in enumerate(models):
        run = simulate_model(model, None, time, current, soc[:, k], celsius[:, k], hold=hold)
        voltage[:, k] = run.voltage_volt
        outside[:, k] = run.extrapolated | run.outside_temperature
    return StringRun(voltage, soc, outside)


def validate_string(models, positions, record):
    """A series pack simulated through a record, against its voltage and what cells were logged.

    Parameters
    ----------
    models : model dicts in the order of the string.
    positions : BranchFacts, in the same order.
    record : Record with cell_voltage_volt and cell_temperature_celsius (n, cells), NaN or
        None where nothing was logged.

    Returns
    -------
    tables : dict: "pack" (one row), "cells" (rows), "series" (columns); errors are measured minus
        simulated. notes : list of sentences for the report.

    Raises
    ------
    Refusal : no SoC at the start can be known, or as `simulate_string`.

    Source: thesis 4.5 (fifty cells under one FUDS current, mean and largest voltage error).
    """
    notes = beyond_calibration(models)
    start = string_soc(models, positions, record, notes)
    celsius = cell_temperatures(record, len(models), notes)
    time, current = record.test_time_second, record.current_ampere
    run = simulate_string(models, time, current, initial_soc=start, temperature_celsius=celsius)
    names = [row.cell for row in positions]
    measured = logged(record.cell_voltage_volt, run.cell_voltage_volt.shape)
    cells = _cell_rows(names, models, run, measured)
    series = _series(record, run, measured, names, contact_of(positions))
    known = np.isfinite(measured).any(axis=0)
    # What a swap must change a cell's voltage by: a share of what the load changes it by.
    moved = rms(run.cell_voltage_volt - run.cell_voltage_volt.mean(axis=0))
    pair = measured[:, known], run.cell_voltage_volt[:, known]
    numbers = np.flatnonzero(known) + 1
    found = swapped(*pair, moved, test=record.test, what="cell", numbers=numbers)
    notes += [finding.sentence for finding in found]
    error = scores(record.voltage_volt - series["simulated_voltage_volt"])
    row = _pack_row(record, run, measured, names, cells, error)
    return {"pack": row, "cells": cells, "series": series}, notes


def contact_of(positions):
    """Resistance of all contacts of a string of BranchFacts together [ohm]; blank ones are none."""
    return float(sum(row.wire_resistance_ohm or 0.0 for row in positions))


def logged(columns, shape):
    """Columns (n, cells) as they were logged, all NaN where there are none."""
    return np.full(shape, np.nan) if columns is None else np.asarray(columns, float)


def string_soc(models, positions, record, notes):
    """SoC of each cell at the start of a record, (cells,) [1].

    Stated in groups.tsv or tests.tsv, else where the cell's OCV is its voltage in the rest at the
    start of the record, else, of a string whose cells were not logged, that of all cells alike at
    which the OCVs add up to the pack's voltage.

    Parameters
    ----------
    models, positions, record : as of `validate_string`. notes : list, to which sentences are added.

    Raises
    ------
    Refusal : SoC is not stated and the record begins under load.
    """
    stated = record.initial_soc
    if stated is None:
        stated = [row.initial_soc for row in positions]
    start = np.array([np.nan if soc is None else soc for soc in stated], float)
    unknown = np.isnan(start)
    if not unknown.any():
        return start
    refuse_start_under_load(record)
    # ASSUME: A string that begins at rest without a stated SoC is at equilibrium.
    first = logged(record.cell_voltage_volt, (len(record.current_ampere), len(models)))[0]
    curves = rested_curves(models, record)
    if not np.isfinite(first[unknown]).all():
        notes.append("SoC at the start: the same for all cells, by the pack's first voltage")
        return np.where(unknown, rested_soc(curves.sum(axis=0), record.voltage_volt[0]), start)
    notes.append("SoC at the start from the cells' first voltages")
    return np.where(unknown, list(map(rested_soc, curves, first)), start)


def rested_curves(models, record):
    """OCV of each cell at the record's first temperature, rising, (cells, POINTS) [V]."""
    grid, celsius = np.linspace(0.0, 1.0, POINTS), float(np.atleast_1d(record.celsius)[0])
    still = np.zeros(POINTS)
    runs = [simulate_model(model, None, still, still, grid, still + celsius) for model in models]
    return np.maximum.accumulate([run.ocv_volt for run in runs], axis=1)


def cell_temperatures(record, cells, notes):
    """Temperature of each cell (n, cells) [degC]: its own sensor, else the mean of those there are.

    Parameters
    ----------
    record : Record. cells : their number. notes : list, to which a sentence may be added.
    """
    shape = (len(record.test_time_second), cells)
    own = logged(record.cell_temperature_celsius, shape)
    known = np.isfinite(own).all(axis=0)
    if not known.any():
        return np.broadcast_to(np.asarray(record.celsius, float)[:, None], shape)
    if not known.all():
        # ASSUME: A cell without a sensor is as warm as the cells with one are on average.
        notes.append(
            f"temperature of {known.sum()} of {cells} cells logged, the others as their mean"
        )
    return np.where(known, own, own[:, known].mean(axis=1, keepdims=True))


def _cell_rows(names, models, run, measured):
    rows = []
    for k, (name, model) in enumerate(zip(names, models, strict=True)):
        found = scores(measured[:, k] - run.cell_voltage_volt[:, k])
        samples = found.pop("samples")
        rows.append(
            {"position": k + 1, "cell": name, "model": model["chosen"]}
            | {"kind": model.get("kind") or ""}
            | {f"{score}_volt": value for score, value in found.items()}
            | {"samples": samples, "extrapolated": float(run.extrapolated[:, k].mean())}
            | {"capacity_ampere_hour": float(model["capacity_ampere_hour"])}
            | {"soc_start": float(run.soc[0, k]), "soc_end": float(run.soc[-1, k])}
        )
    return rows


def _series(record, run, measured, names, contact_ohm):
    """Columns (n,) over time: the pack, its extreme cells by voltage and SoC, measured beside."""
    volt, soc, who = run.cell_voltage_volt, run.soc, np.asarray(names, object)
    columns = {name: getattr(record, name) for name in ("test_time_second", "current_ampere")}
    whole = volt.sum(axis=1) + contact_ohm * record.current_ampere
    columns |= {"voltage_volt": record.voltage_volt, "simulated_voltage_volt": whole}
    columns |= {
        "lowest_cell": who[volt.argmin(axis=1)],
        "lowest_cell_volt": volt.min(axis=1),
        "highest_cell_volt": volt.max(axis=1),
        "least_soc_cell": who[soc.argmin(axis=1)],
        "least_soc": soc.min(axis=1),
        "mean_soc": soc.mean(axis=1),
        "highest_soc": soc.max(axis=1),
    }
    if np.isfinite(measured).all():
        columns["measured_lowest_cell"] = who[measured.argmin(axis=1)]
        columns["measured_lowest_cell_volt"] = measured.min(axis=1)
        columns["measured_highest_cell_volt"] = measured.max(axis=1)
    return columns


def _pack_row(record, run, measured, names, cells, error):
    """One row on the pack: errors, weakest cells, spread of SoC."""
    volt, soc, current = run.cell_voltage_volt, run.soc, record.current_ampere
    scored = [row for row in cells if row["samples"]]
    # At the end of the last discharge, else of the record, the weakest cell shows.
    end = int(np.append(-1, np.flatnonzero(discharging(current)))[-1])
    worst = max(scored, key=lambda row: row["mean_abs_volt"], default=None)
    row = {
        "cells": len(names),
        "voltage_rmse_volt": error["rmse"],
        "voltage_max_abs_volt": error["max_abs"],
        "voltage_mean_volt": error["mean"],
        "cells_logged": len(scored),
        "cell_mean_abs_volt": float(np.mean([r["mean_abs_volt"] for r in scored] or [np.nan])),
        "cell_worst_mean_abs_volt": worst["mean_abs_volt"] if worst else np.nan,
        "cell_worst": worst["cell"] if worst else "",
        "cell_max_abs_volt": max([r["max_abs_volt"] for r in scored], default=np.nan),
        "soc_spread_start": float(np.ptp(soc[0])),
        "soc_spread_end": float(np.ptp(soc[-1])),
        "soc_spread_max": float(np.ptp(soc, axis=1).max()),
        "weakest_by_voltage": names[int(np.argmin(volt[end]))],
        "weakest_by_soc": names[int(np.argmin(soc[end]))],
        "samples": error["samples"],
    }
    return row | _agreement(current, volt, measured, names, end)


def _agreement(current, volt, measured, names, end):
    """Whether the cell of the lowest voltage is found: over the loaded rows, and at the end.

    lowest_cell_gap_volt : how far above the lowest measured voltage the cell lies, in the
    measurement, that the simulation says is lowest, mean over these rows.
    """
    if not np.isfinite(measured).all():
        return {
            "measured_weakest_by_voltage": "",
            "lowest_cell_found_share": np.nan,
            "lowest_cell_gap_volt": np.nan,
        }
    down = discharging(current)
    rows = np.flatnonzero(down if down.any() else np.ones(len(current), bool))
    said, true = volt[rows].argmin(axis=1), measured[rows].argmin(axis=1)
    gap = measured[rows, said] - measured[rows, true]
    return {
        "measured_weakest_by_voltage": names[int(np.argmin(measured[end]))],
        "lowest_cell_found_share": float(np.mean(said == true)),
        "lowest_cell_gap_volt": float(gap.mean()),
    }
