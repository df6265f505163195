"""A parallel group simulated from its cells' models through its record, and scored."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import member_of
from cellwright.circuits.temperature import usual_from_kelvin
from cellwright.numerics.statistics import rms
from cellwright.packs import checks, findings
from cellwright.packs.cells import alike_cells, pack_cells, table_temperatures
from cellwright.packs.compare import passed_ampere_hour, refuse_start_under_load, rested_soc
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.uncertainty.bands import DRAWS, WITHIN_90_PERCENT, band_of
from cellwright.packs.uncertainty.draws import (
    draw_cells,
    drawn_cells,
    is_known,
    of_currents,
    wire_factors,
)
from cellwright.packs.wiring import by_member, cells_of, charge_of, described, member_currents
from cellwright.records.conditions import at_rest_in_record, same_temperature, stated_or_reference
from cellwright.records.record import group_record, stated_soc
from cellwright.refusal import Refusal

ENERGY = "activation_energy_joule_per_mole"


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
    tables : dict: rows of the tables "rows" (one a branch), "findings" and "spread", columns
        "series". notes : list of sentences for the report.

    Raises
    ------
    Refusal : other wirings; branch currents that contradict the total
        (`checks.refuse_contradiction`); a SoC at the start that is not known.
    """
    record, notes = _to_score(test, branches, wiring), checks.beyond_calibration(models)
    # Before tables are made: they follow each model's own energy.
    models, words = of_one_activation_energy(models)
    notes += [*words, *_blind_to_temperature(models, record)]
    record = record._replace(member_current_ampere=_measured(record, branches, notes))
    # A logged temperature is better than one that follows from heat.
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
    offset, noise = _of_sensors(fits, stated, record, notes)
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
    stds = None
    if _tells_intervals(models, uncertainty, notes):
        about = uncertainty, record, start, stated, counted
        drawn = _alike(models, tables, *about) or _drawn(cells, run.soc[0], *about)
        member_ampere, volt = _deviations(run, cells, wiring, record, drawn, warms)
        stds = np.hypot(member_ampere, noise), volt
    # The model's discharge may end later than the record: it is run on to find where.
    discharge = findings.whole_discharge(compared)
    end = np.full((2, len(branches)), np.nan)
    if discharge is not None:
        end = _end(compared, discharge, record.celsius, simulated, wiring)
    finding = findings.findings_of(compared, discharge, end[0])
    of_group = _group_columns(compared, finding, stds)
    return {
        "rows": _rows(compared, branches, cells.members, offset, end, stds, of_group, wiring),
        "findings": [finding],
        "spread": findings.spread_over_soc(compared),
        "series": _series(record, compared, stds),
    }, notes


def of_one_activation_energy(models):
    """Models of a pack's cells, those that saw one chamber temperature with a shared energy.

    A cell that was tested at one chamber temperature tells its energy from its own warming by a few
    kelvin, within 10 kJ/mol or so. Two cells of one type with energies 20 kJ/mol apart would share
    a current in quite another way 10 K above the chamber; of their mean little is wrong. What cells
    that were tested at several temperatures tell serves one that tells nothing.

    Parameters
    ----------
    models : list of model dicts.

    Returns
    -------
    models : list of model dicts, with the mean of the energies of their chosen members. words :
        list of str, what was done.
    """
    # ASSUME: Cells of a pack that were each tested at one temperature have one activation energy; a
    # cell that tells none has that of the pack's cells that were tested at several.
    entries = [member_of(model)["conditions"] for model in models]
    told = [c[ENERGY] for entry in entries if len(entry) > 1 for c in entry if c.get(ENERGY)]
    lacking = [len(entry) == 1 and not entry[0].get(ENERGY) for entry in entries]
    if told and any(lacking):
        mean = float(np.mean(told))
        names = ", ".join(m["cell"] for m, one in zip(models, lacking, strict=True) if one)
        words = f"{names}: tested at one temperature, so the activation energy of its resistance "
        words += f"is taken as {mean / 1e3:.0f} kJ/mol, the mean of the group's other cells"
        pairs = zip(models, lacking, strict=True)
        told_widely = {ENERGY: mean, "activation_energy_kelvin": None}
        return [_with_energy(model, told_widely) if one else model for model, one in pairs], [words]
    single = [c[0] for c in entries if len(c) == 1 and c[0].get(ENERGY)]
    energies = [condition[ENERGY] for condition in single]
    if len(models) < 2 or len(single) < len(models) or np.ptp(energies) == 0:
        return models, []
    mean = float(np.mean(energies))
    words = (
        f"activation energy {mean / 1e3:.0f} kJ/mol for all cells: the mean of the values that "
        f"their self-heating gave ({min(energies) / 1e3:.0f} to {max(energies) / 1e3:.0f})"
    )
    return [_with_energy(model, {ENERGY: mean}) for model in models], [words]


def _blind_to_temperature(models, record):
    """Cells of which no test tells how their resistance follows temperature, in words."""
    celsius = float(np.mean(record.celsius))
    ways = {
        "as at the one temperature it was tested at": [],
        "by the activation energies that cells usually have": [],
    }
    for model in models:
        conditions = member_of(model)["conditions"]
        at = conditions[0]["ambient_temperature_celsius"]
        usual = abs(celsius - stated_or_reference(at)) > usual_from_kelvin(conditions)
        told = len(conditions) > 1 or conditions[0].get(ENERGY)
        if (usual or not told) and not same_temperature(at, celsius):
            list(ways.values())[usual].append(model["cell"])
    return [
        f"{record.test}: {', '.join(cells)} simulated {way}, for no test tells how resistance "
        f"follows temperature, and the record is at {celsius:.0f} °C"
        for way, cells in ways.items()
        if cells
    ]


def _with_energy(model, energy):
    members = [
        member | {"conditions": [condition | energy for condition in member["conditions"]]}
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
        notes.append(f"current of {names} not logged: taken as the total minus the other branches")
    elif len(lacking):
        notes.append(f"currents of {names} were not logged, so they are not scored")
    return currents


def _table_celsius(facts, record, notes):
    """Temperatures of the cells' tables: the chamber's alone, or every 5 K over those logged."""
    low, high = record.celsius.min(), record.celsius.max()
    if high - low < 0.1:  # one reading of a thermometer of tenths
        return stated_or_reference(facts.ambient_temperature_celsius)
    # ASSUME: All cells of a group have the temperature that was logged in it.
    notes.append(f"all cells simulated at the group's measured {low:.0f} to {high:.0f} °C")
    return np.arange(np.floor(low), np.ceil(high) + 5.0, 5.0)


def _initial_soc(stated, cells, wiring, record, notes):
    """SoC of each cell at the start (cells,): stated, else from the rest voltage at the start."""
    if None not in stated:
        return np.array(stated, float)
    if any(not isinstance(member, str) for member in wiring.members):
        raise Refusal(
            f"{wiring.name} is {described(wiring)}: its voltage does not tell the SoC of each "
            "cell, wanted initial_soc of all in groups.tsv"
        )
    refuse_start_under_load(record)
    # ASSUME: A group that starts at rest without a stated SoC is at equilibrium: the OCV of every
    # cell is the group's first voltage.
    notes.append("SoC at the start read from the group's rest voltage")
    looked_up = _soc_at(cells, record, record.voltage_volt[0])
    return np.array([v if s is None else s for s, v in zip(stated, looked_up, strict=True)])


def _soc_at(cells, record, volt):
    """SoC at which each cell's OCV is a voltage, at the record's first temperature (cells,)."""
    near = int(np.argmin(np.abs(cells.temperature_celsius - record.celsius[0])))
    return np.array([rested_soc(curve, volt) for curve in cells.tables["ocv_volt"][near, :, 0]])


def _tells_intervals(models, uncertainty, notes):
    """Whether it is known how sure every cell's model is."""
    unknown = [model["cell"] for model in models if not is_known(model)]
    if uncertainty is not None and unknown:
        notes.append(f"no intervals: the error of the model of {', '.join(unknown)} is not known")
    return uncertainty is not None and not unknown


class _Draws(NamedTuple):
    """Cells as they may be as well: PackCells of a draw (function of its index), SoC at the start
    (draws, cells), and what a voltage is off by beside them [V]."""

    copy_of: Callable
    start_soc: np.ndarray
    shared_volt: float


def _alike(models, celsius, uncertainty, record, start, stated, counted):
    """Draws of cells known from inside their group, as its fit allows; None for other cells."""
    if not all("alike" in model for model in models):
        return None
    copies = alike_cells(models, temperature_celsius=celsius)
    starts = np.zeros((len(copies), len(models))) + start
    if None not in stated:
        starts = starts + draw_cells(uncertainty, draws=len(copies)).initial_soc[:, :1]
    elif not counted:
        first = record.voltage_volt[0]
        looked_up = np.array([_soc_at(one, record, first) for one in copies])
        starts = np.where([one is None for one in stated], looked_up, starts)
    return _Draws(copies.__getitem__, starts, 0.0)


def _drawn(cells, joined_soc, uncertainty, record, start, stated, counted):
    """Draws of cells by how sure their own tests leave them.

    SoC at the start: stated ones are off alike in cells that rest joined; those by the first
    voltage by what the OCV is off.
    """
    drawn = draw_cells(of_currents(uncertainty), draws=DRAWS)
    starts = np.zeros(drawn.capacity_factor.shape) + start
    if None not in stated:
        starts = starts + drawn.initial_soc[:, :1]
    elif not counted:
        # A cell whose OCV is off by so much was looked up at a SoC that is off alike.
        first = record.voltage_volt[0]
        moved = [_soc_at(cells, record, first - volt) for volt in drawn.voltage_volt[:, 0]]
        starts = starts + np.array(moved) - _soc_at(cells, record, first)
    # An error that all models share moves no current, and shows in the voltage in full.
    own = drawn._replace(voltage_volt=np.zeros(drawn.voltage_volt.shape))
    return _Draws(
        lambda draw: drawn_cells(cells, own, draw, joined_soc),
        starts,
        rms(uncertainty.voltage_volt),
    )


def _was_logged(test, record):
    """Whether a temperature of the cells was logged in the group."""
    surface = test.series.get("surface_temperature_celsius")
    on_surface = surface is not None and np.isfinite(surface).all()
    return on_surface or record.cell_temperature_celsius is not None


def _deviations(run, cells, wiring, record, drawn, thermal):
    """Standard deviations of the branch currents (n, branches) and of the voltage (n,)."""
    member_ampere, volt = band_of(
        run,
        cells,
        wiring,
        drawn.copy_of,
        time_second=record.test_time_second,
        total_ampere=record.current_ampere,
        ambient_celsius=record.celsius,
        starts=drawn.start_soc,
        factors=wire_factors(len(drawn.start_soc)),
        thermal=thermal,
    )
    return member_ampere, np.hypot(volt, drawn.shared_volt)


def _counted_back(fitted, record, offset, cells, notes):
    """SoC of each cell at the start (cells,): 0 where its fit began, and the charge before that."""
    time = record.test_time_second
    before = time <= fitted["from_second"]
    passed = passed_ampere_hour(time[before], record.member_current_ampere[before] - offset)
    notes.append(f"SoC is 0 at {fitted['from_second']:.0f} s, where the fit of the cells began")
    return -passed.sum(axis=0) / cells.capacity_ampere_hour


def _of_sensors(fits, stated, record, notes):
    """Offsets of the branch sensors and how far their readings scatter (branches,) [A], 0 where
    nothing tells them."""
    if fits:
        names = ("sensor_offset_ampere", "sensor_noise_ampere")  # the latter not of files of before
        offset, noise = (np.array([fit.get(name, np.nan) for fit in fits]) for name in names)
    elif stated == [None] * len(stated):
        offset, noise = _read_at_start(record)
    else:
        return (np.zeros(record.member_current_ampere.shape[1]),) * 2
    offset, noise = np.nan_to_num(offset), np.nan_to_num(noise)
    if offset.any():
        listed = ", ".join(f"{1e3 * value:+.1f}" for value in offset)
        notes.append(f"offsets of the branch sensors, read at rest and subtracted [mA]: {listed}")
    return offset, noise


# ASSUME: In a rest of a group at equilibrium what a branch sensor reads is its offset.
def _read_at_start(record):
    loaded = np.append(~at_rest_in_record(record.current_ampere), True)
    rows = int(np.argmax(loaded))
    measured = record.member_current_ampere
    # Of fewer than 20 rows the mean is little better than one reading.
    if rows < 20:
        return (np.zeros(measured.shape[1]),) * 2
    return measured[:rows].mean(axis=0), measured[:rows].std(axis=0)


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
        notes.append(f"{np.mean(~unseen):.0%} of the record was fitted, and is not scored")
    return unseen


def _compared(record, run, offset, capacity_ampere_hour, scored, wiring):
    members = by_member(wiring, capacity_ampere_hour)
    sizes = np.array([charge_of(*member) for member in members])
    passed = passed_ampere_hour(record.test_time_second, record.current_ampere)
    first = run.soc[0] @ capacity_ampere_hour / capacity_ampere_hour.sum()
    return findings.Compared(
        time_second=record.test_time_second,
        total_ampere=record.current_ampere,
        voltage_volt=record.voltage_volt,
        measured_ampere=record.member_current_ampere - offset,
        simulated_volt=run.voltage_volt,
        simulated_ampere=member_currents(wiring, run.cell_current_ampere),
        soc=first + np.append(0.0, passed.cumsum()) / sizes.sum(),
        scored=scored,
        capacity_ampere_hour=sizes,
    )


def _end(compared, discharge, celsius, simulated, wiring):
    """Where the discharge ends by the simulation, which may be later than the record's end."""
    time, total = findings.longer(compared, discharge)
    # Run on at the temperature of its last row.
    more = np.full(len(time) - discharge.stop, celsius[discharge.stop - 1])
    run = simulated(time, total, np.append(celsius[: discharge.stop], more))
    currents = member_currents(wiring, run.cell_current_ampere)
    return findings.simulated_end(compared, discharge, time, currents, run.voltage_volt)


def _under_load(compared):
    """Scored rows under load: all, those above and those below 15 % SoC."""
    rows = ~at_rest_in_record(compared.total_ampere) & compared.scored
    low = rows & (compared.soc <= findings.LOW_SOC)
    return {"": rows, "above": rows & ~low, "below": low}


def _ideal(compared):
    """Mean current under load of a branch that carries as much as the others [A]."""
    rows = _under_load(compared)[""]
    return np.abs(compared.total_ampere[rows]).mean() / compared.simulated_ampere.shape[1]


def _group_columns(compared, finding, stds):
    """Columns of table `packs` that are the same for all branches."""
    kirchhoff = compared.simulated_ampere.sum(axis=1) - compared.total_ampere
    volt, rows = compared.voltage_volt - compared.simulated_volt, _under_load(compared)
    measured = finding["group_capacity_ampere_hour"]
    simulated = finding["simulated_group_capacity_ampere_hour"]
    return {
        "voltage_rmse_volt": rms(volt[compared.scored]),
        "voltage_rmse_above_15_soc_volt": rms(volt[rows["above"]]),
        "voltage_rmse_below_15_soc_volt": rms(volt[rows["below"]]),
        "mean_branch_current_ampere": float(_ideal(compared)),
        "kcl_residual_ampere": float(np.abs(kirchhoff).max()),
        "samples": int(compared.scored.sum()),
        "group_capacity_ampere_hour": simulated,
        "measured_group_capacity_ampere_hour": measured,
        "group_capacity_error": simulated / measured - 1,
    } | _interval("voltage", "volt", volt, stds and stds[1], rows[""])


def _rows(compared, branches, members, offset, end, stds, of_group, wiring):
    """Rows of table `packs`, one a branch; `members` are those that the cells run as."""
    error, under_load = compared.measured_ampere - compared.simulated_ampere, _under_load(compared)
    sides = {side: under_load[side] for side in ("above", "below")}
    run_as = [dict.fromkeys(names) for _, names in by_member(wiring, np.array(members))]
    rows = []
    for k, branch in enumerate(branches):
        scored = error[compared.scored, k]
        row = {
            "branch": branch.position,
            "cell": branch.cell,
            "current_rmse_ampere": rms(scored),
            "current_max_ampere": float(np.abs(scored).max()),
            "capacity_ampere_hour": float(compared.capacity_ampere_hour[k]),
            "model": "+".join(run_as[k]),
            "sensor_offset_ampere": float(offset[k]),
            "charge_ampere_hour": float(end[0][k]),
            "largest_current_ampere": float(end[1][k]),
        }
        row |= {
            f"relative_current_rmse_{side}_15_soc": rms(error[chosen, k]) / _ideal(compared)
            for side, chosen in sides.items()
        }
        std = stds and stds[0][:, k]
        row |= _interval("current", "ampere", error[:, k], std, under_load[""])
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


def _series(record, compared, stds):
    """Columns of artefact `pack_series`; branch currents without the offsets of the sensors."""
    names = ("test_time_second", "current_ampere", "voltage_volt")
    columns = {name: getattr(record, name) for name in names}
    columns |= {"simulated_voltage_volt": compared.simulated_volt, "scored": compared.scored}
    columns["soc"] = compared.soc
    for k in range(compared.measured_ampere.shape[1]):
        columns[f"branch_{k + 1}_current_ampere"] = compared.measured_ampere[:, k]
        columns[f"simulated_branch_{k + 1}_current_ampere"] = compared.simulated_ampere[:, k]
        if stds is not None:
            columns[f"branch_{k + 1}_current_std_ampere"] = stds[0][:, k]
    return columns if stds is None else columns | {"voltage_std_volt": stds[1]}
