"""A parallel group simulated from its cells' models through its record, and scored."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.packs import checks, findings
from cellwright.packs.cells import pack_cells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import cells_of, described
from cellwright.records.basis import stated_or_reference
from cellwright.records.record import group_record, stated_soc
from cellwright.refusal import Refusal

REST_SHARE = 0.02  # of the largest current: below it the group rests
TABLE_KELVIN = 5.0  # between the temperatures of the cells' tables
OFFSET_ROWS = 20  # of a rest at the start, at least, for the offset of a branch sensor


class GroupValidation(NamedTuple):
    """Scores of a group, a row a branch, the series they are from, sentences for the report.

    rows, findings, spread : list of dict, rows of the tables `packs`, `pack_findings` and
    `pack_spread`. series : dict of columns (n,). notes : tuple of str.
    """

    rows: list
    findings: list
    spread: list
    series: dict
    notes: tuple


def validate_group(models, branches, test, wiring):
    """Group simulated through its whole record, scored on the rows not used for the fit.

    1. Each cell runs as its chosen member, at the temperature that was logged in the group, else
    at the chamber's. 2. Where no SoC is stated at the start, the group is taken to rest there in
    equilibrium: every cell's OCV is the group's first voltage, and what the branch sensors read is
    their offset, which is taken out. 3. Models from the group's own record name the rows that they
    were fitted to, which are not scored, and the offsets found there.

    Parameters
    ----------
    models : list of model dicts, in the order of the wiring's leaves.
    branches : list of BranchFacts, of the members of the wiring.
    test : MeasuredTest of the group, with branch_<k>_current_ampere.
    wiring : wiring.Wiring of cells in parallel, as a star or a ladder.

    Returns
    -------
    validation : GroupValidation.

    Raises
    ------
    Refusal
        Other wirings; a branch without a measured current; branch currents that contradict the
        total (`checks.refuse_contradiction`); a SoC at the start that is not known.
    """
    record, notes = _to_score(test, branches, wiring), checks.beyond_calibration(models)
    cells = pack_cells(models, temperature_celsius=_table_celsius(test.facts, record, notes))
    if None in [row.wire_resistance_ohm for row in branches]:
        notes.append("wire resistances are not stated: taken as none beyond the cells' own")
    fits = [m["fitted"] for m in models if m.get("fitted", {}).get("test") == record.test]
    fits = fits if len(fits) == len(models) else []
    offset = _offset(fits, branches, test.facts, record, notes)
    stated = stated_soc(test.facts, branches)
    if fits and stated == [None] * len(stated):
        start = _counted_back(fits[0], record, offset, cells, notes)
    else:
        start = _initial_soc(stated, cells, record, notes)

    def simulated(time_second, total_ampere, celsius):
        return simulate_pack(
            time_second, total_ampere, cells, wiring, initial_soc=start, ambient_celsius=celsius
        )

    run = simulated(record.test_time_second, record.current_ampere, record.celsius)
    scored = _unseen(models, record, notes)
    compared = _compared(record, run, offset, cells.capacity_ampere_hour, scored)
    discharge = findings.whole_discharge(compared)
    end = None if discharge is None else _end(compared, discharge, record.celsius, simulated)
    finding = findings.findings_of(compared, discharge, end)
    return GroupValidation(
        rows=_rows(compared, branches, cells, offset, finding, end),
        findings=[finding],
        spread=findings.spread_over_soc(compared),
        series=_series(record, compared),
        notes=tuple(notes),
    )


def _to_score(test, branches, wiring):
    """Record of a test with currents of all branches, which agree with the total."""
    if wiring.connection != "parallel" or len(cells_of(wiring)) != len(branches):
        raise Refusal(f"found {described(wiring)}, wanted single cells in parallel")
    record = group_record(test, branches)
    if record.branch_current_ampere is None:
        raise Refusal(f"{record.test} has no current of one branch or more: nothing to score")
    checks.refuse_contradiction(record, wiring)
    return record


def _table_celsius(facts, record, notes):
    """Temperatures of the cells' tables: the chamber's alone, or every 5 K over those logged."""
    low, high = record.celsius.min(), record.celsius.max()
    if high - low < 0.1:
        return stated_or_reference(facts.ambient_temperature_celsius)
    # ASSUME: All cells of a group have the temperature that was logged in it.
    notes.append(f"cells at the group's measured temperature, {low:.0f} to {high:.0f} °C")
    return np.arange(np.floor(low), np.ceil(high) + TABLE_KELVIN, TABLE_KELVIN)


def _initial_soc(stated, cells, record, notes):
    """SoC of each cell at the start (cells,): stated, else from the rest voltage at the start."""
    if None not in stated:
        return np.array(stated, float)
    total = record.current_ampere
    if abs(total[0]) > REST_SHARE * np.abs(total).max():
        raise Refusal("initial_soc is not stated in groups.tsv, and the record begins under load")
    # ASSUME: A group that starts at rest without a stated SoC is at equilibrium: the OCV of every
    # cell is the group's first voltage.
    notes.append("SoC at the start from the group's first voltage")
    near = int(np.argmin(np.abs(cells.temperature_celsius - record.celsius[0])))
    rising = np.maximum.accumulate(cells.ocv_volt[near, :, 0], axis=1)
    grid = np.linspace(0.0, 1.0, rising.shape[1])
    looked_up = [np.interp(record.voltage_volt[0], curve, grid) for curve in rising]
    return np.array([v if s is None else s for s, v in zip(stated, looked_up, strict=True)])


def _counted_back(fitted, record, offset, cells, notes):
    """SoC of each cell at the start (cells,): 0 where its fit began, and the charge before that."""
    time = record.test_time_second
    before = time <= fitted["from_second"]
    current = record.branch_current_ampere[before] - offset
    passed = np.diff(time[before])[:, None] * (current[1:] + current[:-1]) / 7200.0
    notes.append(f"SoC counted from 0 at {fitted['from_second']:.0f} s, as in the fit of the cells")
    return -passed.sum(axis=0) / cells.capacity_ampere_hour


def _offset(fits, branches, facts, record, notes):
    """Offsets of the branch sensors (branches,) [A], 0 where nothing tells them."""
    if fits:
        offset = np.array([fit["sensor_offset_ampere"] for fit in fits])
    elif stated_soc(facts, branches) == [None] * len(branches):
        offset = _read_at_start(record)
    else:
        return np.zeros(len(branches))
    if not offset.any():
        return offset
    listed = ", ".join(f"{1e3 * value:+.1f}" for value in offset)
    notes.append(f"offsets of the branch sensors [mA], read in a rest and taken out: {listed}")
    return offset


# ASSUME: In a rest of a group at equilibrium what a branch sensor reads is its offset.
def _read_at_start(record):
    total = np.abs(record.current_ampere)
    resting = np.append(total > REST_SHARE * total.max(), True)
    rows = int(np.argmax(resting))
    measured = record.branch_current_ampere
    return measured[:rows].mean(axis=0) if rows >= OFFSET_ROWS else np.zeros(measured.shape[1])


def _unseen(models, record, notes):
    """Rows (n,) of the record outside the stretch that the models were fitted to."""
    time = record.test_time_second
    unseen = np.ones(len(time), bool)
    for fitted in (model.get("fitted") for model in models):
        if fitted and fitted["test"] == record.test:
            unseen &= (time < fitted["from_second"]) | (time > fitted["to_second"])
    if not unseen.any():
        raise Refusal("the models were fitted to the whole record: nothing is left to score")
    if not unseen.all():
        notes.append(f"{np.mean(~unseen):.0%} of the record was fitted and is not scored")
    return unseen


def _compared(record, run, offset, capacity_ampere_hour, scored):
    return findings.Compared(
        time_second=record.test_time_second,
        total_ampere=record.current_ampere,
        voltage_volt=record.voltage_volt,
        measured_ampere=record.branch_current_ampere - offset,
        simulated_volt=run.voltage_volt,
        simulated_ampere=run.cell_current_ampere,
        soc=run.soc @ (capacity_ampere_hour / capacity_ampere_hour.sum()),
        scored=scored,
        capacity_ampere_hour=capacity_ampere_hour,
    )


def _end(compared, discharge, celsius, simulated):
    """Where the discharge ends by the simulation, which may be later than the record's end."""
    time, total = findings.longer(compared, discharge)
    more = np.full(len(time) - discharge.stop, celsius[discharge.stop - 1])
    run = simulated(time, total, np.append(celsius[: discharge.stop], more))
    return findings.simulated_end(
        compared, discharge, time, run.cell_current_ampere, run.voltage_volt
    )


def _rows(compared, branches, cells, offset, finding, end):
    """Rows of table `packs`, one a branch."""
    kirchhoff = compared.simulated_ampere.sum(axis=1) - compared.total_ampere
    volt = compared.voltage_volt - compared.simulated_volt
    under_load = findings.loaded(compared.total_ampere) & compared.scored
    ideal = np.abs(compared.total_ampere[under_load]).mean() / len(branches)
    low = under_load & (compared.soc <= findings.LOW_SOC)
    bands = {"above": under_load & ~low, "below": low}
    of_group = {
        "voltage_rmse_volt": rms(volt[compared.scored]),
        "voltage_rmse_above_15_soc_volt": _rms(volt[bands["above"]]),
        "voltage_rmse_below_15_soc_volt": _rms(volt[low]),
        "mean_branch_current_ampere": float(ideal),
        "kcl_residual_ampere": float(np.abs(kirchhoff).max()),
        "samples": int(compared.scored.sum()),
    }
    of_group |= _capacity_of_group(finding)
    error = compared.measured_ampere - compared.simulated_ampere
    unknown = np.full(len(branches), np.nan)
    charge, largest = (unknown, unknown) if end is None else end
    rows = []
    for k, branch in enumerate(branches):
        scored = error[compared.scored, k]
        row = {
            "branch": branch.position,
            "cell": branch.cell,
            "current_rmse_ampere": rms(scored),
            "current_max_ampere": float(np.abs(scored).max()),
            "capacity_ampere_hour": float(cells.capacity_ampere_hour[k]),
            "model": cells.members[k],
            "sensor_offset_ampere": float(offset[k]),
            "charge_ampere_hour": float(charge[k]),
            "largest_current_ampere": float(largest[k]),
        }
        row |= {
            f"relative_current_rmse_{side}_15_soc": _rms(error[rows_of_band, k]) / ideal
            for side, rows_of_band in bands.items()
        }
        rows.append(row | of_group)
    return rows


def _rms(values):
    return rms(values) if len(values) else np.nan


def _capacity_of_group(finding):
    """Capacity of the group as measured and simulated [Ah], and the error [1]."""
    measured = finding["group_capacity_ampere_hour"]
    simulated = finding["simulated_group_capacity_ampere_hour"]
    return {
        "group_capacity_ampere_hour": simulated,
        "measured_group_capacity_ampere_hour": measured,
        "group_capacity_error": simulated / measured - 1,
    }


def _series(record, compared):
    """Columns of artefact `pack_series`; branch currents without the offsets of the sensors."""
    names = ("test_time_second", "current_ampere", "voltage_volt")
    columns = {name: getattr(record, name) for name in names}
    columns |= {"simulated_voltage_volt": compared.simulated_volt, "scored": compared.scored}
    columns["soc"] = compared.soc
    for k in range(compared.measured_ampere.shape[1]):
        columns[f"branch_{k + 1}_current_ampere"] = compared.measured_ampere[:, k]
        columns[f"simulated_branch_{k + 1}_current_ampere"] = compared.simulated_ampere[:, k]
    return columns
