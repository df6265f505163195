"""Tests of cells and of parallel groups laid out on the SoC scale, with the rows that are used."""

from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from cellwright.messages import said_of
from cellwright.numerics.clock import refuse_backward
from cellwright.numerics.noise import least_digit, least_digit_ampere
from cellwright.records.anchor import AS_STATED, Anchored, slow_soc
from cellwright.records.basis import at_cycle, on_scale, soc_of
from cellwright.records.blocks import fit_mask
from cellwright.records.channels import (
    BRANCH_CURRENT,
    CELL_TEMPERATURE,
    CELL_VOLTAGE,
    logged,
    refuse_beyond,
    table,
)
from cellwright.records.conditions import AT_REST_C_RATE, REFERENCE_CELSIUS, same_temperature
from cellwright.records.filled import bridged, with_edges
from cellwright.records.repeats import counted_once
from cellwright.refusal import Refusal
from cellwright.series.rest_current import as_logged

BY_SHEET, BY_NOTHING = "the chamber's", "25 °C, for want of any"
STATED = (BY_SHEET, BY_NOTHING)  # sources of a temperature that no sensor told


class Record(NamedTuple):
    """One test of a cell on the SoC scale, or of a group. It starts from rest; arrays (n,).

    test, kind, role : name, kind and role, as in the sheet.
    test_time_second, current_ampere, voltage_volt : [s], [A] positive on charge, [V].
    soc : by the instrument's counter, which also knows what passed while nothing was recorded [1];
        NaN after the first row where there is none: the current alone then tells.
    celsius : temperature of the cell, see `cell_temperature` [°C].
    used : bool, rows that are compared with a model; the others only drive its states.
    thinned : bool, rows before which others were dropped, for nothing stepped there.
    resistance_factor : of the resistances at `celsius` over those that a model states; 1 as long as
        no law over temperature has been applied [1].
    anchor, temperature_source : in words, where soc and celsius are from.
    simulated_volt : voltage of the test that the user simulated, None where there is none [V].
    anchor_second : time of the row whose SoC is known, from which all others are counted [s]; None
        for the first.
    least_digit_ampere, least_digit_volt : of the readings, see `noise.least_digit` [A], [V].
    started_second : when it began, since 1970 by the laboratory's clock [s]; None: not known.

    Of a group alone, whose members and cells count as in its wiring and whose `celsius` is that
    around them; it has no SoC of its own:
    initial_soc : (members,) stated at its start [1], or None.
    member_current_ampere : (n, members), NaN where not logged, None where none was [A].
    cell_voltage_volt, cell_temperature_celsius : (n, cells), likewise [V], [degC].
    """

    test: str
    kind: str
    role: str
    test_time_second: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    celsius: np.ndarray
    used: np.ndarray
    thinned: np.ndarray
    resistance_factor: np.ndarray
    anchor: str = ""
    temperature_source: str = ""
    simulated_volt: np.ndarray | None = None
    anchor_second: float | None = None
    least_digit_ampere: float = 0.0
    least_digit_volt: float = 0.0
    started_second: float | None = None
    initial_soc: np.ndarray | None = None
    member_current_ampere: np.ndarray | None = None
    cell_voltage_volt: np.ndarray | None = None
    cell_temperature_celsius: np.ndarray | None = None

    @property
    def branch_current_ampere(self):
        """Current of each member (n, members) [A], None where one was not logged."""
        currents = self.member_current_ampere
        lacking = currents is None or np.isnan(currents).all(axis=0).any()
        return None if lacking else currents


def record_of(
    test_time_second,
    current_ampere,
    voltage_volt,
    soc,
    *,
    test="",
    kind="drive",
    role="fit",
    celsius=REFERENCE_CELSIUS,
    used=None,
    resistance_factor=1.0,
    anchor="",
    temperature_source="",
):
    """Record of columns that are on the SoC scale already; `laid_out` makes one of a test.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt : (n,) [s], [A], [V].
    soc : (n,) as counted, or that of the first row where nothing was counted [1].
    test, kind, role : as in the sheet.
    celsius : scalar or (n,) [°C].
    used : (n,) bool, rows that are compared with a model; None takes all.
    resistance_factor : scalar or (n,) [1].
    anchor, temperature_source : in words.

    Returns
    -------
    record : Record, nothing of it checked; see `checked`.
    """
    rows = len(test_time_second)
    if np.ndim(soc) == 0:
        soc = np.append(soc, np.full(rows - 1, np.nan))
    numbers = (test_time_second, current_ampere, voltage_volt, soc, celsius)
    return Record(
        test,
        kind,
        role,
        *(np.broadcast_to(np.asarray(column, float), (rows,)).copy() for column in numbers),
        np.ones(rows, bool) if used is None else np.asarray(used, bool),
        np.zeros(rows, bool),
        np.broadcast_to(np.asarray(resistance_factor, float), (rows,)).copy(),
        anchor,
        temperature_source,
        # A reading is a whole number of digits, so zero is a level of it as well.
        least_digit_ampere=least_digit_ampere(current_ampere),
        least_digit_volt=least_digit(voltage_volt),
    )


def checked(record):
    """The same record, refused where its values are not finite or its clock runs back.

    Parameters
    ----------
    record : Record, or another with test_time_second, current_ampere, voltage_volt and celsius.

    Raises
    ------
    Refusal : a value that is not finite, or a clock that runs back, with the row.
    """
    for name in ("test_time_second", "current_ampere", "voltage_volt", "celsius"):
        wrong = np.flatnonzero(~np.isfinite(getattr(record, name)))
        if len(wrong):
            value = getattr(record, name)[wrong[0]]
            raise Refusal(f"row {wrong[0]} of {name} is {value}, not a number")
    refuse_backward(record.test_time_second)
    return record


def laid_out(test, basis, cell, *, split_rest_second, proof=False, as_read=False):
    """A test of a cell on the SoC scale, with its temperature and the rows that are compared.

    1. The SoC is counted from the best anchor that there is (`basis.soc_of`), of a slow test from
    its own end. 2. The temperature is
    the cell's own, see `cell_temperature`. 3. Of a test of role `split` the odd blocks are compared
    in a fit and the even ones in a proof; of any other test all rows. Rows that count in another
    test (`repeats.counted_once`) are not compared, and drive the model all the same.

    Parameters
    ----------
    test : MeasuredTest.
    basis : dict, from `basis.basis`, or a model that holds capacity and OCV of one.
    cell : CellFacts.
    split_rest_second : shortest rest that cuts a test of role `split` [s].
    proof : compare what a fit leaves of a test of role `split`.
    as_read : take the current as the instrument read it, with what cleaning did not count, and the
        chamber's temperature as it was measured; the blocks are cut by the cleaned current all the
        same.

    Returns
    -------
    record : Record.

    Raises
    ------
    Refusal : as `soc_of`, `fit_mask` and `checked`; a single row.
    """
    facts, series = test
    basis = at_cycle(basis, facts.cycle)
    columns = as_logged(series) if as_read else series
    time = columns["test_time_second"]
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a model needs a course of time")
    if facts.kind == "ocv":
        size = {"capacity_ampere_hour": basis["capacity_ampere_hour"]}
        anchored = slow_soc(columns["charge_ampere_hour"], **size)
    else:
        anchored = soc_of(columns, basis, facts, cell)
    celsius, source = cell_temperature(facts, columns, as_read=as_read)
    used = np.ones(len(time), bool)
    if facts.role == "split":
        rest = AT_REST_C_RATE * basis["capacity_ampere_hour"]
        cut = series["current_ampere"]
        used = fit_mask(time, cut, rest_second=split_rest_second, rest_ampere=rest) ^ proof
    if "repeated" in columns:
        used &= ~columns["repeated"]
    return checked(
        record_of(
            time,
            columns["current_ampere"],
            columns["voltage_volt"],
            anchored.soc,
            test=facts.test,
            kind=facts.kind,
            role=facts.role,
            celsius=celsius,
            used=used,
            anchor=anchored.anchor,
            temperature_source=source,
        )._replace(
            simulated_volt=columns.get("simulated_voltage_volt"),
            anchor_second=float(time[anchored.row]),
            started_second=started_second(facts, columns),
        )
    )


def started_second(facts, series):
    """When a test began, since 1970 by the laboratory's clock [s]: as stated, else by its dates.

    Parameters
    ----------
    facts : TestFacts. series : dict of (n,) columns.

    Returns
    -------
    second : [s], None where neither the sheet nor the file has a date.
    """
    if facts.started is not None:
        # No zone is stated, and only differences are used: taken as if the clock were that of UTC.
        return datetime.fromisoformat(facts.started).replace(tzinfo=UTC).timestamp()
    dates = np.asarray(series.get("unix_time_second", ()), float)
    known = np.flatnonzero(np.isfinite(dates))
    if not len(known):
        return None
    elapsed = series["test_time_second"][known[0]] - series["test_time_second"][0]
    return float(dates[known[0]] - elapsed)


def laid_out_to_fit(test, basis, cell, **settings):
    """As `laid_out`, with gaps and edges filled, refused where the SoC leaves −0.1 to 1.1.

    Parameters
    ----------
    test, basis, cell : as in `laid_out`. settings : those of `laid_out`.

    Returns
    -------
    record : Record.

    Raises
    ------
    Refusal : as `laid_out` and `on_scale`.
    """
    record, aged = laid_out(test, basis, cell, **settings), at_cycle(basis, test.facts.cycle)
    on_scale(Anchored(record.soc, record.anchor), aged)
    size = aged["capacity_ampere_hour"]
    return with_edges(bridged(record, capacity_ampere_hour=size), capacity_ampere_hour=size)


def cell_temperature(facts, series, *, as_read=False):
    """Temperature of a cell along a test: its measured surface, else the chamber, else 25 °C.

    The chamber's is the stated one, at which a model has its conditions: air that swings by tenths
    of a kelvin within minutes tells less of a cell. A search for effects, which asks what a reading
    is worth, takes the measured one where there is one.

    Parameters
    ----------
    facts : TestFacts. series : dict of (n,) columns.
    as_read : take the measured temperature of the chamber before the stated one.

    Returns
    -------
    celsius : (n,) [°C]. source : in words.
    """
    # ASSUME: A model's temperature is that of the cell's surface where it was measured, else the
    # chamber's: the core of a loaded cell is warmer.
    measured = {"the surface's measured": series.get("surface_temperature_celsius")}
    if as_read:
        measured["the chamber's measured"] = series.get("ambient_temperature_celsius")
    for source, celsius in measured.items():
        if celsius is not None and np.isfinite(celsius).all():
            return np.asarray(celsius, float), source
    stated = facts.ambient_temperature_celsius
    source = BY_NOTHING if stated is None else BY_SHEET
    held = REFERENCE_CELSIUS if stated is None else stated
    return np.full(len(series["test_time_second"]), float(held)), source


class FitRecords(NamedTuple):
    """The records of one temperature, ready to be fitted.

    celsius : of the chamber, to which the resistances of the fit belong [°C]. records : tuple of
    Record. pulsed : excited by pulses at set points, not by drives or long loads.
    """

    celsius: float
    records: tuple
    pulsed: bool


def records_by_temperature(tests, basis, cell, *, split_rest_second):
    """Records by chamber temperature, coldest first; tests of one temperature belong together.

    At each temperature HPPC tests and beside them capacity tests, whose long loads show what
    pulses do not; where there is no HPPC, drives. Of a cell with neither, capacity tests alone.

    Parameters
    ----------
    tests : list of MeasuredTest, roles fit or split.
    basis : dict, from `basis.basis`. cell : CellFacts.
    split_rest_second : shortest rest that cuts a test of role `split` [s].

    Returns
    -------
    conditions : list of FitRecords. notes : list of str, what was left out and why.
    """
    conditions, notes = [], []
    settings = {"split_rest_second": split_rest_second}
    together = list(_by_temperature(tests))
    all_tests = [test for _, members in together for test in members]
    marked, words = _counted_once(all_tests, basis, cell, settings)
    notes += words
    once = iter(marked)
    for celsius, members in [(c, [next(once) for _ in of]) for c, of in together]:
        laid = [_record_to_fit(test, basis, cell, settings, notes) for test in members]
        records = tuple(record for record in laid if record is not None)
        if records:
            pulsed = any(test.facts.kind == "hppc" for test in members)
            conditions.append(FitRecords(celsius, records, pulsed))
    return conditions, notes


def lone_loads(tests, conditions):
    """Capacity tests at temperatures of which nothing is fitted.

    Tables over SoC cannot be told by them beside the pulses or drives of other temperatures; one
    set of numbers for all temperatures can.

    Parameters
    ----------
    tests : list of MeasuredTest. conditions : as of `records_by_temperature`.
    """
    return [
        test
        for test in tests
        if test.facts.kind == "capacity"
        and not any(same_temperature(_chamber_celsius(test), one.celsius) for one in conditions)
    ]


def _counted_once(tests, basis, cell, settings):
    """As `counted_once`; a test that cannot be fitted takes no measurement from the others."""
    marked, words = counted_once(tests)
    if not words:
        return marked, words
    usable = [t for t in tests if _record_to_fit(t, basis, cell, settings, []) is not None]
    marked, words = counted_once(usable)
    once = {test.facts.test: test for test in marked}
    return [once.get(test.facts.test, test) for test in tests], words


def _record_to_fit(test, basis, cell, settings, notes):
    """Record of a test, None with a note where it cannot be fitted."""
    try:
        record = laid_out_to_fit(test, basis, cell, **settings)
    except Refusal as refusal:
        notes.append(f"not fitted: {test.facts.test}: {refusal}")
        return None
    if not record.used.any():
        notes.append(f"not fitted: {test.facts.test}: all of it counts in another test")
        return None
    if not record.anchor.startswith(AS_STATED):
        notes.append(said_of(record.test, f"SoC by {record.anchor}"))
    return record


def _by_temperature(tests):
    by_celsius, of_cell = {}, {test.facts.kind for test in tests}
    for test in sorted(tests, key=_chamber_celsius):
        celsius = _chamber_celsius(test)
        same = [t for t in by_celsius if same_temperature(t, celsius)]
        by_celsius.setdefault(same[0] if same else celsius, []).append(test)
    for celsius, members in by_celsius.items():
        kinds_to_fit = _kinds_to_fit({test.facts.kind for test in members}, of_cell)
        chosen = [test for test in members if test.facts.kind in kinds_to_fit]
        if chosen:
            yield celsius, chosen


def _kinds_to_fit(kinds, of_cell):
    """Kinds of test that are fitted at a temperature, of the kinds there and of the whole cell."""
    if "hppc" in kinds:
        return {"hppc", "capacity"}
    return {"drive"} if of_cell & {"hppc", "drive"} else {"capacity"}


def _chamber_celsius(test):
    """Chamber temperature as stated, else the mean of the cell's, 25 °C where nothing is known."""
    stated = test.facts.ambient_temperature_celsius
    return float(cell_temperature(*test)[0].mean()) if stated is None else stated


def group_record(test, branches, *, cells=None):
    """Record of a test of a group, with whichever of its channels were logged.

    Parameters
    ----------
    test : MeasuredTest of a group. branches : list of BranchFacts, in order of position.
    cells : how many cells the group's wiring has; None: one a branch.

    Returns
    -------
    record : Record of a group.

    Raises
    ------
    Refusal : channels of more branches or cells than there are.
    """
    facts, series = test
    cells = cells or len(branches)
    try:
        refuse_beyond(series, members=len(branches), cells=cells)
    except Refusal as refusal:
        raise Refusal(f"{facts.test}: {refusal}") from None
    initial_soc = stated_soc(facts, branches)
    return record_of(
        *(series[name] for name in ("test_time_second", "current_ampere", "voltage_volt")),
        np.nan,
        test=facts.test,
        kind=facts.kind,
        role=facts.role,
        celsius=cell_temperature(facts, series, as_read=True)[0],
    )._replace(
        initial_soc=None if None in initial_soc else np.array(initial_soc, float),
        member_current_ampere=table(series, BRANCH_CURRENT, len(branches)),
        cell_voltage_volt=table(series, CELL_VOLTAGE, cells),
        cell_temperature_celsius=table(series, CELL_TEMPERATURE, cells),
    )


def branch_currents(series):
    """Measured branch currents (n, branches) of a group's series [A], None where not logged.

    Parameters
    ----------
    series : dict of (n,) columns, those of the branches named branch_<k>_current_ampere.
    """
    names = [BRANCH_CURRENT.format(number) for number in logged(series, BRANCH_CURRENT)]
    return np.column_stack([series[name] for name in names]) if names else None


def stated_soc(facts, branches):
    """SoC of each branch at the start of a test [1]: the test's, else the branch's; None: neither.

    Parameters
    ----------
    facts : TestFacts. branches : list of BranchFacts.
    """
    return [row.initial_soc if facts.soc is None else facts.soc for row in branches]
