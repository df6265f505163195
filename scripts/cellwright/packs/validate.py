"""A parallel group simulated from its cells' models through its record, and scored."""

from functools import partial
from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import member_of
from cellwright.numerics.statistics import rms
from cellwright.packs import checks, findings
from cellwright.packs.cells import pack_cells, table_temperatures
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.uncertainty.bands import DRAWS, WITHIN_90_PERCENT, band_of
from cellwright.packs.uncertainty.draws import draw_cells, is_known, wire_factors
from cellwright.packs.wiring import cells_of, described, member_currents
from cellwright.records.conditions import at_rest_in_record, stated_or_reference
from cellwright.records.record import group_record, stated_soc
from cellwright.refusal import Refusal

TABLE_KELVIN = 5.0  # between the temperatures of the cells' tables
ENERGY = "activation_energy_joule_per_mole"
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


def validate_group(models, branches, test, wiring, *, leaves=None, uncertainty=None, thermal=None):
    """Group simulated through its whole record, scored on the rows not used for the fit.

    1. Each cell runs as its chosen member, at the temperature that was logged in the group, else
    at that which its own heat gives it, else at the chamber's; see `of_one_activation_energy`.
    2. Where no SoC is stated at the start, the group is taken to rest there in equilibrium: every
    cell's OCV is the group's first voltage, and what the branch sensors read is their offset, which
    is taken out. 3. Models from the group's own record name the rows that they were fitted to,
    which are not scored, the offsets found there, and where the SoC is 0. 4. Where it is known how
    sure the cells' models are, so are the branch currents and the voltage (`uncertainty.bands`).

    Parameters
    ----------
    models : list of model dicts, in the order of the wiring's leaves.
    branches : list of BranchFacts, of the members of the wiring.
    test : MeasuredTest of the group, with branch_<k>_current_ampere.
    wiring : wiring.Wiring of members in parallel, as a star or a ladder; members may be groups.
    leaves : list of BranchFacts of all cells, in the order of the leaves, of which the SoC at the
        start counts; None: the members are cells.
    uncertainty : Uncertainty of all cells, in the order of the leaves; None: no intervals.
    thermal : Thermal of all cells, likewise, which warm by their own heat where no temperature was
        logged in the group; None: they have the chamber's.

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
    models, words = of_one_activation_energy(models)
    notes += words
    measured = _measured(record, branches, notes)
    record = record._replace(branch_current_ampere=measured)
    warms = None if thermal is None or _was_logged(test, record) else thermal
    if warms is None:
        tables = _table_celsius(test.facts, record, notes)
    else:
        tables = table_temperatures(models, record.celsius)
        notes.append("temperature of the cells from their own heat: none was logged in the group")
    cells = pack_cells(models, temperature_celsius=tables)
    if None in [row.wire_resistance_ohm for row in branches]:
        notes.append("wire resistances are not stated: taken as none beyond the cells' own")
    fits = [m["fitted"] for m in models if m.get("fitted", {}).get("test") == record.test]
    fits = fits if len(fits) == len(models) else []
    stated = stated_soc(test.facts, leaves or branches)
    offset = _offset(fits, stated, record, notes)
    counted = fits and stated == [None] * len(stated)
    if counted:
        start = _counted_back(fits[0], record, offset, cells, notes)
    else:
        start = _initial_soc(stated, cells, wiring, record, notes)

    def simulated(time_second, total_ampere, celsius):
        around = {"initial_soc": start, "ambient_celsius": celsius, "thermal": warms}
        return simulate_pack(time_second, total_ampere, cells, wiring, **around)

    run = simulated(record.test_time_second, record.current_ampere, record.celsius)
    scored = _unseen(models, record, notes)
    compared = _compared(record, run, offset, cells.capacity_ampere_hour, scored, wiring)
    band = None
    if _tells_intervals(models, uncertainty, notes):
        starts = partial(_drawn_starts, stated, counted, cells, record, start)
        band = _band(run, cells, wiring, record, uncertainty, starts, warms)
    discharge = findings.whole_discharge(compared)
    end = None
    if discharge is not None:
        end = _end(compared, discharge, record.celsius, simulated, wiring)
    finding = findings.findings_of(compared, discharge, end)
    return GroupValidation(
        rows=_rows(compared, branches, _members_run(wiring, cells), offset, finding, end, band),
        findings=[finding],
        spread=findings.spread_over_soc(compared),
        series=_series(record, compared, band),
        notes=tuple(notes),
    )


def of_one_activation_energy(models):
    """Models of a pack's cells, of one activation energy where each saw one chamber temperature.

    A cell that was tested at one chamber temperature tells its energy from its own warming by a few
    kelvin, within 10 kJ/mol or so. Two cells of one type with energies 20 kJ/mol apart would share
    a current in quite another way 10 K above the chamber; of their mean little is wrong.

    Parameters
    ----------
    models : list of model dicts.

    Returns
    -------
    models : list of model dicts, with the mean of the energies of their chosen members. words :
        list of str, what was done.
    """
    # ASSUME: Cells of a pack that were each tested at one temperature have one activation energy.
    entries = [member_of(model)["conditions"] for model in models]
    single = [c[0] for c in entries if len(c) == 1 and c[0].get(ENERGY)]
    energies = [condition[ENERGY] for condition in single]
    if len(models) < 2 or len(single) < len(models) or np.ptp(energies) == 0:
        return models, []
    mean = float(np.mean(energies))
    words = (
        f"activation energy {mean / 1e3:.0f} kJ/mol for all cells, the mean of what each tells "
        f"from its own warming ({min(energies) / 1e3:.0f} to {max(energies) / 1e3:.0f})"
    )
    return [_with_energy(model, mean) for model in models], [words]


def _with_energy(model, joule_per_mole):
    members = [
        member | {"conditions": [c | {ENERGY: joule_per_mole} for c in member["conditions"]]}
        for member in model["members"]
    ]
    return model | {"members": members}


def _to_score(test, branches, wiring):
    """Record of a test whose branch currents agree with the total; NaN where none was logged."""
    if wiring.connection != "parallel":
        raise Refusal(f"found {described(wiring)}, wanted members in parallel")
    record = group_record(test, branches, cells=len(cells_of(wiring)))
    checks.refuse_contradiction(record, wiring)
    if record.cell_temperature_celsius is not None:
        # ASSUME: Cells of a group have the mean of the temperatures logged at them.
        record = record._replace(celsius=np.nanmean(record.cell_temperature_celsius, axis=1))
    return record


def _measured(record, branches, notes):
    """Measured branch currents (n, branches) [A], one that was not logged by the others."""
    currents = record.member_current_ampere
    if currents is None:
        notes.append("no branch current was logged: the voltage alone is scored")
        return np.full((len(record.current_ampere), len(branches)), np.nan)
    lacking = np.flatnonzero(np.isnan(currents).all(axis=0))
    names = ", ".join(branches[k].cell for k in lacking)
    if len(lacking) == 1:
        currents = currents.copy()
        currents[:, lacking[0]] = record.current_ampere - np.nansum(currents, axis=1)
        notes.append(f"current of {names} not logged: the total less the others, no measurement")
    elif len(lacking):
        notes.append(f"currents of {names} not logged and not scored")
    return currents


def _table_celsius(facts, record, notes):
    """Temperatures of the cells' tables: the chamber's alone, or every 5 K over those logged."""
    low, high = record.celsius.min(), record.celsius.max()
    if high - low < 0.1:
        return stated_or_reference(facts.ambient_temperature_celsius)
    # ASSUME: All cells of a group have the temperature that was logged in it.
    notes.append(f"cells at the group's measured temperature, {low:.0f} to {high:.0f} °C")
    return np.arange(np.floor(low), np.ceil(high) + TABLE_KELVIN, TABLE_KELVIN)


def _initial_soc(stated, cells, wiring, record, notes):
    """SoC of each cell at the start (cells,): stated, else from the rest voltage at the start."""
    if None not in stated:
        return np.array(stated, float)
    if any(not isinstance(member, str) for member in wiring.members):
        raise Refusal(
            f"{wiring.name} is {described(wiring)}: its voltage does not tell the SoC of each "
            "cell, wanted initial_soc of all in groups.tsv"
        )
    if not at_rest_in_record(record.current_ampere)[0]:
        raise Refusal("initial_soc is not stated in groups.tsv, and the record begins under load")
    # ASSUME: A group that starts at rest without a stated SoC is at equilibrium: the OCV of every
    # cell is the group's first voltage.
    notes.append("SoC at the start from the group's first voltage")
    looked_up = _rested_soc(cells, record, record.voltage_volt[0])
    return np.array([v if s is None else s for s, v in zip(stated, looked_up, strict=True)])


def _rested_soc(cells, record, volt):
    """SoC at which each cell's OCV is a voltage, at the record's first temperature (cells,)."""
    near = int(np.argmin(np.abs(cells.temperature_celsius - record.celsius[0])))
    rising = np.maximum.accumulate(cells.ocv_volt[near, :, 0], axis=1)
    grid = np.linspace(0.0, 1.0, rising.shape[1])
    return np.array([np.interp(volt, curve, grid) for curve in rising])


def _tells_intervals(models, uncertainty, notes):
    """Whether it is known how sure every cell's model is."""
    unknown = [model["cell"] for model in models if not is_known(model)]
    if uncertainty is not None and unknown:
        notes.append(f"no intervals: nothing tells how sure the model of {', '.join(unknown)} is")
    return uncertainty is not None and not unknown


def _drawn_starts(stated, counted, cells, record, start, drawn):
    """SoC at the start in each draw (draws, cells), by how it was found.

    Stated ones are off alike in cells that rest joined; those by the first voltage by what the OCV
    is off; one that was counted from the fit of its cells is part of that fit.
    """
    nothing = np.zeros(drawn.capacity_factor.shape)
    if counted:
        return nothing + start
    if None not in stated:
        return nothing + start + drawn.initial_soc[:, :1]
    first, shift = record.voltage_volt[0], drawn.voltage_volt[:, 0]
    moved = _rested_soc(cells, record, first)
    found = [start + _rested_soc(cells, record, first - volt) - moved for volt in shift]
    return np.array(found)


def _was_logged(test, record):
    """Whether a temperature of the cells was logged in the group."""
    surface = test.series.get("surface_temperature_celsius")
    told = surface is not None and np.isfinite(surface).all()
    return told or record.cell_temperature_celsius is not None


def _band(run, cells, wiring, record, uncertainty, starts, thermal):
    """Standard deviations of the branch currents and of the voltage: Band."""
    drawn = draw_cells(uncertainty, draws=DRAWS)
    still = drawn._replace(voltage_volt=np.zeros(drawn.voltage_volt.shape))
    band = band_of(
        run,
        cells,
        wiring,
        still,
        time_second=record.test_time_second,
        total_ampere=record.current_ampere,
        ambient_celsius=record.celsius,
        starts=starts(drawn),
        factors=wire_factors(DRAWS, wire_relative_std=uncertainty.wire_relative_std),
        thermal=thermal,
    )
    alike = rms(uncertainty.voltage_volt)
    return band._replace(voltage_volt=np.hypot(band.voltage_volt, alike))


def _counted_back(fitted, record, offset, cells, notes):
    """SoC of each cell at the start (cells,): 0 where its fit began, and the charge before that."""
    time = record.test_time_second
    before = time <= fitted["from_second"]
    current = record.branch_current_ampere[before] - offset
    passed = np.diff(time[before])[:, None] * (current[1:] + current[:-1]) / 7200.0
    notes.append(f"SoC counted from 0 at {fitted['from_second']:.0f} s, as in the fit of the cells")
    return -passed.sum(axis=0) / cells.capacity_ampere_hour


def _offset(fits, stated, record, notes):
    """Offsets of the branch sensors (branches,) [A], 0 where nothing tells them."""
    if fits:
        offset = np.array([fit["sensor_offset_ampere"] for fit in fits])
    elif stated == [None] * len(stated):
        offset = _read_at_start(record)
    else:
        return np.zeros(record.branch_current_ampere.shape[1])
    offset = np.nan_to_num(offset)
    if not offset.any():
        return offset
    listed = ", ".join(f"{1e3 * value:+.1f}" for value in offset)
    notes.append(f"offsets of the branch sensors [mA], read in a rest and taken out: {listed}")
    return offset


# ASSUME: In a rest of a group at equilibrium what a branch sensor reads is its offset.
def _read_at_start(record):
    loaded = np.append(~at_rest_in_record(record.current_ampere), True)
    rows = int(np.argmax(loaded))
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


def _capacities_of_members(wiring, capacity_ampere_hour):
    """Capacity of each member [Ah]: of groups the sum of parallel, the least of series members."""
    sizes, first = [], 0
    for member in wiring.members:
        stop = first + len(cells_of(member))
        size = capacity_ampere_hour[first]
        if not isinstance(member, str):
            inner = _capacities_of_members(member, capacity_ampere_hour[first:stop])
            size = inner.sum() if member.connection == "parallel" else inner.min()
        sizes.append(size)
        first = stop
    return np.array(sizes)


def _compared(record, run, offset, capacity_ampere_hour, scored, wiring):
    sizes = _capacities_of_members(wiring, capacity_ampere_hour)
    steps, total = np.diff(record.test_time_second), record.current_ampere
    passed = np.append(0.0, (steps * (total[1:] + total[:-1])).cumsum() / 7200.0)
    first = run.soc[0] @ capacity_ampere_hour / capacity_ampere_hour.sum()
    return findings.Compared(
        time_second=record.test_time_second,
        total_ampere=record.current_ampere,
        voltage_volt=record.voltage_volt,
        measured_ampere=record.branch_current_ampere - offset,
        simulated_volt=run.voltage_volt,
        simulated_ampere=member_currents(wiring, run.cell_current_ampere),
        soc=first + passed / sizes.sum(),
        scored=scored,
        capacity_ampere_hour=sizes,
    )


def _end(compared, discharge, celsius, simulated, wiring):
    """Where the discharge ends by the simulation, which may be later than the record's end."""
    time, total = findings.longer(compared, discharge)
    more = np.full(len(time) - discharge.stop, celsius[discharge.stop - 1])
    run = simulated(time, total, np.append(celsius[: discharge.stop], more))
    currents = member_currents(wiring, run.cell_current_ampere)
    return findings.simulated_end(compared, discharge, time, currents, run.voltage_volt)


def _members_run(wiring, cells):
    """What each member of the group runs as: names of the circuits' members, joined by +."""
    first, names = 0, []
    for member in wiring.members:
        stop = first + len(cells_of(member))
        names.append("+".join(dict.fromkeys(cells.members[first:stop])))
        first = stop
    return names


def _rows(compared, branches, members_run, offset, finding, end, band):
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
    volt_std = None if band is None else band.voltage_volt
    of_group |= _interval("voltage", "volt", volt, volt_std, under_load)
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
            "capacity_ampere_hour": float(compared.capacity_ampere_hour[k]),
            "model": members_run[k],
            "sensor_offset_ampere": float(offset[k]),
            "charge_ampere_hour": float(charge[k]),
            "largest_current_ampere": float(largest[k]),
        }
        row |= {
            f"relative_current_rmse_{side}_15_soc": _rms(error[rows_of_band, k]) / ideal
            for side, rows_of_band in bands.items()
        }
        std = None if band is None else band.member_ampere[:, k]
        row |= _interval("current", "ampere", error[:, k], std, under_load)
        rows.append(row | of_group)
    return rows


def _interval(name, unit, error, std, counted):
    """Half the width of the interval of 90 %, mean over rows, and the share of them inside."""
    half = np.full(counted.sum(), np.nan) if std is None else WITHIN_90_PERCENT * std[counted]
    inside = np.abs(error[counted]) <= half
    known = len(half) and std is not None and np.isfinite(error[counted]).all()
    return {
        f"{name}_interval_{unit}": float(half.mean()) if len(half) else np.nan,
        f"{name}_inside_interval": float(inside.mean()) if known else np.nan,
    }


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


def _series(record, compared, band):
    """Columns of artefact `pack_series`; branch currents without the offsets of the sensors."""
    names = ("test_time_second", "current_ampere", "voltage_volt")
    columns = {name: getattr(record, name) for name in names}
    columns |= {"simulated_voltage_volt": compared.simulated_volt, "scored": compared.scored}
    columns["soc"] = compared.soc
    for k in range(compared.measured_ampere.shape[1]):
        columns[f"branch_{k + 1}_current_ampere"] = compared.measured_ampere[:, k]
        columns[f"simulated_branch_{k + 1}_current_ampere"] = compared.simulated_ampere[:, k]
        if band is not None:
            columns[f"branch_{k + 1}_current_std_ampere"] = band.member_ampere[:, k]
    if band is not None:
        columns["voltage_std_volt"] = band.voltage_volt
    return columns
