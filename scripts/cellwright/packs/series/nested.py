"""A pack of groups in groups through its record, held against whichever channels were logged."""

import numpy as np

from cellwright.packs.cells import pack_cells, table_temperatures
from cellwright.packs.checks import beyond_calibration
from cellwright.packs.compare import refuse_start_under_load, rested_soc, scores
from cellwright.packs.series.string import rested_curves
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import by_member, cells_of, described, member_currents
from cellwright.records.channels import BRANCH_CURRENT, CELL_VOLTAGE


def nested_pack(models, wiring, positions, record):
    """A pack of any wiring simulated from its cells' chosen members through a record, and scored.

    1. SoC at the start is stated for each cell, or all cells are alike and rest: the one SoC at
    which their OCVs give the pack's first voltage. 2. The whole record is simulated
    (`simulate_pack`). 3. Errors are measured minus simulated, of the pack's voltage and of every
    branch current and cell voltage that was logged.

    Parameters
    ----------
    models : model dicts in the order of the leaves. wiring : Wiring.
    positions : BranchFacts of the cells, in the same order. record : Record of a group.

    Returns
    -------
    tables : dict: "rows", a row a channel that was logged, and "series", its columns.
    notes : list of sentences for the report.

    Raises
    ------
    Refusal : SoC is not stated and the record begins under load, or as `simulate_pack`.
    """
    notes = beyond_calibration(models)
    start = _start(models, wiring, positions, record, notes)
    time, total, celsius = record.test_time_second, record.current_ampere, record.celsius
    # A chamber that a sensor reads steady within its tenth of a kelvin has one temperature.
    tables = np.mean(celsius) if np.ptp(celsius) < 0.1 else table_temperatures(models, celsius)
    cells = pack_cells(models, temperature_celsius=tables)
    about = {"initial_soc": start, "ambient_celsius": celsius}
    run = simulate_pack(time, total, cells, wiring, **about)
    names = [part if isinstance(part, str) else part.name for part in wiring.members]
    series = {"test_time_second": time, "current_ampere": total}
    pack = record.voltage_volt[:, None], run.voltage_volt[:, None]
    branches = record.member_current_ampere, member_currents(wiring, run.cell_current_ampere)
    volts = record.cell_voltage_volt, run.cell_voltage_volt
    rows = []
    for what, channel, unit, owners, (read, simulated) in (
        ("pack voltage", "voltage_volt", "V", [wiring.name], pack),
        ("branch current", BRANCH_CURRENT, "A", names, branches),
        ("cell voltage", CELL_VOLTAGE, "V", cells_of(wiring), volts),
    ):
        for k in () if read is None else np.flatnonzero(np.isfinite(read).any(axis=0)).tolist():
            name, found = channel.format(k + 1), scores(read[:, k] - simulated[:, k])
            about = {"channel": what, "number": k + 1, "of": owners[k]}
            about |= {score: found[score] for score in ("rmse", "max_abs", "mean")}
            rows.append(about | {"unit": unit, "samples": found["samples"]})
            series |= {name: read[:, k], f"simulated_{name}": simulated[:, k]}
    rows[0]["number"] = None  # there is one pack voltage
    return {"rows": rows, "series": series}, notes


def _start(models, wiring, positions, record, notes):
    """SoC of each cell when the record begins, (cells,) [1]."""
    stated = [row.initial_soc for row in positions]
    if record.initial_soc is not None:
        stated = list(np.broadcast_to(record.initial_soc[:1], len(positions)))
    if None not in stated:
        return np.array(stated, float)
    refuse_start_under_load(record, f"for every cell of {described(wiring)}")
    # ASSUME: A pack of groups that begins at rest without a stated SoC has its cells at one SoC.
    curve = _rested(wiring, rested_curves(models, record).T)
    soc = rested_soc(curve, record.voltage_volt[0])
    notes.append(f"SoC at the start: {soc:.3f} for all cells, by the pack's first voltage")
    return np.array([soc if value is None else value for value in stated], float)


def _rested(part, curves):
    """Voltage at rest of a cell or group over the SoC of all its cells, (POINTS,) [V]."""
    if isinstance(part, str):
        return curves[:, 0]
    volts = [_rested(*member) for member in by_member(part, curves)]
    return np.sum(volts, axis=0) if part.connection == "series" else np.mean(volts, axis=0)
