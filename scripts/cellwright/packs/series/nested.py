"""A pack of groups in groups through its record, held against whichever channels were logged."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.packs.cells import pack_cells, table_temperatures
from cellwright.packs.checks import beyond_calibration
from cellwright.packs.series.string import POINTS, rested_curves
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import cells_of, described, member_currents
from cellwright.records.channels import BRANCH_CURRENT, CELL_VOLTAGE
from cellwright.records.conditions import at_rest_in_record
from cellwright.refusal import Refusal


class NestedPack(NamedTuple):
    """Errors of a pack, a row a channel that was logged; its series; sentences for the report."""

    rows: list
    series: dict
    notes: tuple


def nested_pack(models, wiring, positions, record):
    """A pack of any wiring simulated from its cells' chosen members through a record, and scored.

    1. SoC at the start is stated for each cell, or all cells are alike and rest: the one SoC at
    which their OCVs give the pack's first voltage. 2. The whole record is simulated
    (`simulate_pack`). 3. Errors are measured minus simulated, of the pack's voltage and of every
    branch current and cell voltage that was logged.

    Parameters
    ----------
    models : model dicts in the order of the leaves. wiring : Wiring.
    positions : BranchFacts of the cells, in the same order. record : GroupRecord of the pack.

    Returns
    -------
    pack : NestedPack.

    Raises
    ------
    Refusal : SoC is not stated and the record begins under load, or as `simulate_pack`.
    """
    notes = beyond_calibration(models)
    start = _start(models, wiring, positions, record, notes)
    celsius = record.celsius
    tables = np.mean(celsius) if np.ptp(celsius) < 0.1 else table_temperatures(models, celsius)
    cells = pack_cells(models, temperature_celsius=tables)
    run = simulate_pack(
        record.test_time_second,
        record.current_ampere,
        cells,
        wiring,
        initial_soc=start,
        ambient_celsius=celsius,
    )
    members = member_currents(wiring, run.cell_current_ampere)
    rows = [_errors("pack voltage", None, wiring.name, "V", record.voltage_volt, run.voltage_volt)]
    names = [part if isinstance(part, str) else part.name for part in wiring.members]
    leaves = cells_of(wiring)
    series = {name: getattr(record, name) for name in ("test_time_second", "current_ampere")}
    series |= {"voltage_volt": record.voltage_volt, "simulated_voltage_volt": run.voltage_volt}
    for what, channel, unit, owners, read, simulated in (
        ("branch current", BRANCH_CURRENT, "A", names, record.member_current_ampere, members),
        (
            "cell voltage",
            CELL_VOLTAGE,
            "V",
            leaves,
            record.cell_voltage_volt,
            run.cell_voltage_volt,
        ),
    ):
        found, columns = _channels(what, channel, unit, owners, read, simulated)
        rows, series = rows + found, series | columns
    return NestedPack(rows, series, tuple(notes))


def _channels(what, channel, unit, owners, read, simulated):
    """Rows and columns of the numbered channels of one kind that were logged."""
    rows, columns = [], {}
    told = () if read is None else np.flatnonzero(np.isfinite(read).any(axis=0))
    for k in told:
        rows.append(_errors(what, int(k) + 1, owners[k], unit, read[:, k], simulated[:, k]))
        name = channel.format(k + 1)
        columns |= {name: read[:, k], f"simulated_{name}": simulated[:, k]}
    return rows, columns


def _errors(what, number, owner, unit, read, simulated):
    error = (read - simulated)[np.isfinite(read)]
    return {
        "channel": what,
        "number": number,
        "of": owner,
        "rmse": rms(error),
        "max_abs": float(np.abs(error).max()),
        "mean": float(error.mean()),
        "unit": unit,
        "samples": len(error),
    }


def _start(models, wiring, positions, record, notes):
    """SoC of each cell when the record begins, (cells,) [1]."""
    stated = [row.initial_soc for row in positions]
    if record.initial_soc is not None:
        stated = list(np.broadcast_to(record.initial_soc[:1], len(positions)))
    if None not in stated:
        return np.array(stated, float)
    if not at_rest_in_record(record.current_ampere)[0]:
        raise Refusal(
            f"{record.test}: initial_soc is not stated for every cell of {described(wiring)}, and "
            "the record begins under load"
        )
    # ASSUME: A pack of groups that begins at rest without a stated SoC has its cells at one SoC.
    curve = _rested(wiring, rested_curves(models, record))
    soc = float(np.interp(record.voltage_volt[0], curve, np.linspace(0.0, 1.0, POINTS)))
    notes.append(f"SoC at the start: {soc:.3f} for all cells, by the pack's first voltage")
    return np.array([soc if value is None else value for value in stated], float)


def _rested(part, curves):
    """Voltage at rest of a cell or group over the SoC of all its cells, (POINTS,) [V]."""
    if isinstance(part, str):
        return curves[0]
    volts, first = [], 0
    for member in part.members:
        count = len(cells_of(member))
        volts.append(_rested(member, curves[first : first + count]))
        first += count
    return np.sum(volts, axis=0) if part.connection == "series" else np.mean(volts, axis=0)
