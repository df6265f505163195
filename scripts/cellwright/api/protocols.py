"""Analyses of one test: capacity, OCV, pulses, rests, dQ/dV, impedance, fast charge, ageing."""

import numpy as np

from cellwright.api import inputs, results
from cellwright.settings import FastCharge, Ica, Impedance, Ocv, OcvStep, Relaxation, Resistance

OCV = Ocv()
ICA = Ica()


def course(tests, cell):
    """The tests of one cell in time: which came before each, and whether it left the cell full.

    Parameters
    ----------
    tests : (test, clean series, result of `segment`) each.
    cell : CellFacts or mapping: rating [Ah] and cut-offs [V].

    Returns
    -------
    course : Result; rows: columns, one entry a test: test_before, hour_between
        [h], state_at_begin ("full", "empty" or "" where not known) and words.

    Raises
    ------
    Refusal : A cut-off is not stated, so that no end of a test can be told.

    Source: docs/capacity.md.
    """
    from cellwright.protocols.course import course as course_of
    from cellwright.protocols.course import ends_of_test
    from cellwright.refusal import Refusal

    facts = inputs.cell_facts(cell)
    limits = {name: getattr(facts, name) for name in ("lower_cutoff_volt", "upper_cutoff_volt")}
    if None in limits.values():
        raise Refusal("a cut-off is not stated, so whether a test ends full or empty is not known")
    rated = facts.rated_capacity_ampere_hour
    ends = [
        ends_of_test(
            inputs.test_facts(test).test,
            inputs.columns(series, *inputs.COUNTED),
            inputs.steps(steps),
            rated_capacity_ampere_hour=rated,
            **limits,
        )
        for test, series, steps in tests
    ]
    return results.Result({"rows": course_of(ends, **limits)})


def _before(course, test):
    """State in which the test before left the cell, by the result of `course` ("" where none), and
    the SoC at the start that the sheet states [1], or None."""
    rows = inputs.rows(course) if course is not None else []
    facts = inputs.test_facts(test) if test is not None else None
    name, soc = (None, None) if facts is None else (facts.test, facts.soc)
    state = next((row["state_at_begin"] for row in rows if row["test"] == name), "")
    return {"state_before": state, "soc_at_start": soc}


def _nearest(curves, test):
    """The open-circuit voltage curve that is nearest to a test in temperature, or None."""
    from cellwright.records.basis import curve_at

    if not curves:
        return None
    celsius = None if test is None else inputs.test_facts(test).ambient_temperature_celsius
    return curve_at(curves, celsius)


def capacity(series, steps, cell, *, whole_swing=False, test=None, course=None, curves=()):
    """Capacities [Ah] of the complete charges and discharges of one test.

    Parameters
    ----------
    series : DataFrame or columns of a clean series, (n,) each.
    steps : result of `segment`, or a table of its columns.
    cell : CellFacts or mapping: rating [Ah] and cut-offs [V].
    whole_swing : a half cycle that ends short of the cut-off counts too, as in slow OCV tests.
    test, course : TestFacts or mapping, result of `course`: how the test before left the cell.
    curves : list of dict, open-circuit voltages of the cell that a stated SoC is held against.

    Returns
    -------
    capacities : Result; rows: columns (k,), as `protocols.capacity`: charge [Ah], energy [Wh],
        rate [1/h], efficiency [1]. Half cycles left out are in the notes.

    Raises
    ------
    Refusal : No complete charge or discharge.

    Source: docs/capacity.md.
    """
    from cellwright.protocols.capacity import capacity as capacities

    columns, facts = inputs.columns(series, *inputs.COUNTED), inputs.cell_facts(cell)
    half_cycles = capacities(
        *inputs.quantities(columns, inputs.COUNTED),
        inputs.steps(steps),
        rated_capacity_ampere_hour=facts.rated_capacity_ampere_hour,
        lower_cutoff_volt=facts.lower_cutoff_volt,
        upper_cutoff_volt=facts.upper_cutoff_volt,
        surface_temperature_celsius=columns.get("surface_temperature_celsius"),
        whole_swing=whole_swing,
        **_before(course, test),
        curve=_nearest(curves, test),
    )
    return results.Result({"rows": half_cycles.rows}, notes=tuple(half_cycles.left_out))


def ocv(series, cell, *, least_hour=OCV.least_hour, test=None):
    """Open-circuit voltage [V] over SoC of one slow test: a curve, and functions fitted to it.

    Parameters
    ----------
    series : DataFrame or columns of a clean series, (n,) each.
    cell : CellFacts or mapping: cut-offs [V].
    least_hour : shortest charge or discharge that is slow enough [h].
    test : TestFacts or mapping: its SoC at the start, or None.

    Returns
    -------
    ocv : Result; curve: `protocols.ocv.slow.OcvCurve` over SoC, functions: list of OcvFunction.

    Raises
    ------
    Refusal : No charge or discharge is slow enough or complete.

    Source: docs/ocv.md.
    """
    from cellwright.protocols.ocv.functions import fit_functions
    from cellwright.protocols.ocv.slow import slow_ocv

    columns, facts = inputs.columns(series, *inputs.COUNTED), inputs.cell_facts(cell)
    curve = slow_ocv(
        *inputs.quantities(columns, inputs.COUNTED),
        file_index=columns.get("file_index"),
        lower_cutoff_volt=facts.lower_cutoff_volt,
        upper_cutoff_volt=facts.upper_cutoff_volt,
        least_hour=least_hour,
        soc_at_start=None if test is None else inputs.test_facts(test).soc,
    )
    notes = tuple(filter(None, [curve.note]))
    tables = {"curve": curve, "functions": fit_functions(curve.soc, curve.ocv_volt)}
    return results.Result(tables, notes=notes)


def ocv_from_rests(
    series, steps, cell, test, capacities=(), *, rest_second=OCV.rest_second, course=None
):
    """Open-circuit voltage [V] over SoC from the rests of a pulse test.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    cell, test : CellFacts, TestFacts or mappings.
    capacities : (test, result of `capacity`) each, or rows with their test's facts.
    rest_second : shortest rest that is a point of the curve [s].
    course : result of `course`: how the test before left the cell.

    Returns
    -------
    ocv : Result; curve over SoC as of `ocv`, points: dict of (k,) columns, one entry a rest.

    Raises
    ------
    Refusal : No capacity, or too few rests.

    Source: docs/ocv.md.
    """
    from cellwright.protocols.ocv.rests import ocv_of_rests, rest_points, soc_at
    from cellwright.records.anchor import rest_scale

    cell, test, steps = inputs.cell_facts(cell), inputs.test_facts(test), inputs.steps(steps)
    columns = inputs.quantities(series, inputs.COUNTED)
    scale = rest_scale(
        *columns[1:],
        steps,
        inputs.entries(capacities),
        rated_capacity_ampere_hour=cell.rated_capacity_ampere_hour,
        state_of_health=cell.state_of_health,
        lower_cutoff_volt=cell.lower_cutoff_volt,
        upper_cutoff_volt=cell.upper_cutoff_volt,
        ambient_temperature_celsius=test.ambient_temperature_celsius,
        cycle=test.cycle,
        **_before(course, test),
    )
    points = rest_points(*columns, steps, rest_second=rest_second)
    limits = {name: getattr(cell, name) for name in ("lower_cutoff_volt", "upper_cutoff_volt")}
    curve = ocv_of_rests(points, scale, **limits)
    table = points._asdict() | {"soc": soc_at(points, scale)}
    tables, words = {"curve": curve, "points": table}, {"capacity_source": scale.source}
    return results.Result(tables, words, (curve.note,))


def chamber_steps(series, steps, basis, test, cell, settings=None, **changes):
    """Shifts [V] of the open-circuit voltage in rests while the chamber temperature steps.

    Parameters
    ----------
    series, steps : clean series with surface temperature, (n,) columns, and its steps.
    basis : result of `basis`.
    test, cell : TestFacts, CellFacts or mappings.
    settings : `settings.OcvStep`, or its keys as keywords.

    Returns
    -------
    shifts : Result; one row a plateau: shift [V] and its uncertainty, temperatures [°C], SoC [1].

    Raises
    ------
    Refusal : No rest with two steady temperatures.

    Source: thesis 3.3; docs/ocv-temperature.md.
    """
    from cellwright.api.charge import state_of_charge
    from cellwright.protocols.ocv.steps import cell_temperature, chamber_shifts

    columns, anchored = inputs.columns(series), state_of_charge(series, basis, test, cell)
    shifts = chamber_shifts(
        *inputs.quantities(columns, ("test_time_second", "voltage_volt")),
        cell_temperature(columns),
        anchored.soc,
        inputs.steps(steps),
        **inputs.settings_of(OcvStep, settings, changes)._asdict(),
    )
    notes = (f"SoC: {anchored.anchor}", *shifts.left_out)
    return results.Result({"rows": shifts.rows}, notes=notes)


def resistance(series, steps, basis, test, cell, settings=None, *, repeats=None, **changes):
    """Resistance [ohm] at stated delays into each pulse of one test.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    basis : result of `basis`.
    test, cell : TestFacts, CellFacts or mappings.
    settings : `settings.Resistance`, or its key as keyword: delay_second [s].
    repeats : result of `repeats` of the cell's tests: what counts in another test is left out.

    Returns
    -------
    resistances : Result; rows: `protocols.resistance.ResistanceRows`, (k,): resistance_ohm and
        resistance_std_ohm [ohm] by SoC [1], direction and delay [s]; SoC is NaN where not known.

    Raises
    ------
    Refusal : The record has no pulse from a rest, or none that can be read.

    Source: docs/resistance.md.
    """
    from cellwright.api.charge import state_of_charge
    from cellwright.protocols.resistance import pulse_resistance

    anchored = state_of_charge(series, basis, test, cell)
    pulses = pulse_resistance(
        *inputs.quantities(series),
        anchored.soc,
        inputs.steps(steps),
        elsewhere=inputs.elsewhere(repeats, test, steps),
        rated_capacity_ampere_hour=inputs.basis(basis)["capacity_ampere_hour"],
        **inputs.settings_of(Resistance, settings, changes)._asdict(),
    )
    notes = (f"SoC: {anchored.anchor}", *pulses.left_out)
    return results.Result({"rows": pulses.rows}, notes=notes)


def relaxation(series, steps, basis, test, cell, settings=None, *, repeats=None, **changes):
    """Two exponentials fitted to the voltage of each rest of one test: amplitudes, time constants.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    basis : result of `basis`.
    test, cell : TestFacts, CellFacts or mappings.
    settings : `settings.Relaxation`, or its keys as keywords.
    repeats : as of `resistance`.

    Returns
    -------
    relaxation : Result; rows: `protocols.rests.RestRows`, (k,): amplitudes [V], time constants
        [s] and their uncertainty; curve: voltage over time of one rest.

    Raises
    ------
    Refusal : No rest after a load is long enough.

    Source: thesis 3.3; docs/relaxation.md.
    """
    from cellwright.api.charge import state_of_charge
    from cellwright.protocols.rests import chamber_or_cell, example, rests_of
    from cellwright.records.anchor import AS_STATED

    columns = inputs.columns(series, *inputs.NAMES)
    time, current, voltage = inputs.quantities(columns)
    anchored = state_of_charge(columns, basis, test, cell)
    rests = rests_of(
        time,
        current,
        voltage,
        anchored.soc,
        inputs.steps(steps),
        temperature_celsius=chamber_or_cell(columns),
        elsewhere=inputs.elsewhere(repeats, test, steps),
        **inputs.settings_of(Relaxation, settings, changes)._asdict(),
    )
    shown = example(rests.rows, time, voltage)
    stated = inputs.test_facts(test).soc is not None
    told = np.isnan(anchored.soc).all() or (stated and not anchored.anchor.startswith(AS_STATED))
    where = [f"SoC: {anchored.anchor}"] if told else []
    tables = {"rows": rests.rows, "curve": shown}
    return results.Result(tables, notes=(*where, *rests.left_out))


def ica(series, steps):
    """Incremental capacity dQ/dV [Ah/V] over voltage of the constant-current charge in one test.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.

    Returns
    -------
    ica : Result; curve: `protocols.ica.curve.IncrementalCapacity` [Ah/V] over voltage [V].

    Raises
    ------
    Refusal : No constant-current charge, or one over too small a voltage.

    Source: docs/ica.md.
    """
    from cellwright.protocols.ica.charge import charge_slope, constant_current_charge, constant_rows

    steps = inputs.steps(steps)._asdict()
    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    current, voltage, charge = inputs.quantities(series, names)
    first, last, step = constant_current_charge(steps, charge)
    first, last = constant_rows(current, first, last)
    rows = slice(first, last + 1)
    curve, slope = charge_slope(voltage[rows], charge[rows])
    # The mean current of a step that holds the voltage in the end is less than its constant one.
    rated = steps["current_mean_ampere"][step] / steps["c_rate"][step]
    about = {"c_rate": float(np.median(current[rows]) / rated), "slope": slope}
    return results.Result({"curve": curve}, about)


def ica_peaks(ica, *, prominence=ICA.prominence):
    """Peaks of the incremental capacity of one charge: voltage [V], height [Ah/V], area [Ah].

    Parameters
    ----------
    ica : result of `ica`.
    prominence : least rise of a peak, as a share of the highest dQ/dV [1].

    Returns
    -------
    peaks : Result; (k,) columns: voltage [V], height [Ah/V], area [Ah], width [V], each with its
        standard deviation.

    Raises
    ------
    Refusal : No peaks.
    """
    from cellwright.protocols.ica.charge import charge_peaks

    options = {"c_rate": ica.c_rate, "prominence": prominence}
    return results.Result({"rows": charge_peaks(ica.slope, **options)})


def impedance(spectrum, settings=None, **changes):
    """One spectrum analysed: Kramers-Kronig test, circuit fit, distribution of relaxation times.

    Parameters
    ----------
    spectrum : DataFrame or columns: frequency_hertz [Hz], impedance_real_ohm and
        impedance_imaginary_ohm [ohm], (n,) each.
    settings : `settings.Impedance`, or its keys as keywords.

    Returns
    -------
    impedance : Result.

    Raises
    ------
    Refusal : An unknown circuit, too few points, or none that can be trusted.

    Source: thesis 3.2; docs/impedance.md.
    """
    from cellwright.protocols.impedance import analyse

    names = ("frequency_hertz", "impedance_real_ohm", "impedance_imaginary_ohm")
    columns = inputs.columns(spectrum, *names)
    analysis = analyse(
        columns[names[0]],
        columns[names[1]] + 1j * columns[names[2]],
        temperature_celsius=columns.get("surface_temperature_celsius"),
        **inputs.settings_of(Impedance, settings, changes)._asdict(),
    )
    found = analysis._asdict()
    tables = {"rows": [found.pop("row")], **found}
    return results.Result(tables, notes=tables.pop("notes"))


def thermometer(spectra, series):
    """Offset [K] between the temperature in a cell's spectra and that of its other records at rest.

    Parameters
    ----------
    spectra : (test, result of `impedance`, or its row) each. series : (test, clean series) each.

    Returns
    -------
    offsets : Result; one row a chamber temperature: the offset [K], NaN without either reading.
    """
    from cellwright.protocols.impedance.trust import rested_temperature, temperature_offsets

    names = ("test_time_second", "current_ampere", "surface_temperature_celsius")
    read = [
        (test, inputs.rows(getattr(entry, "rows", [entry]))[0]["temperature_celsius"])
        for test, entry in spectra
    ]
    at_rest = [
        (test, rested_temperature(*[inputs.columns(entry).get(name) for name in names]))
        for test, entry in series
    ]
    pairs = [
        [(inputs.test_facts(test).ambient_temperature_celsius, celsius) for test, celsius in entry]
        for entry in (read, at_rest)
    ]
    rows, notes = temperature_offsets(*pairs)
    return results.Result({"rows": rows}, notes=tuple(notes))


def fast_charge(series, steps, basis, cell, settings=None, *, cycle=None, soc=None, **changes):
    """Share of the capacity [1] that a fast charge reaches in its minutes, and what limits it.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    basis : result of `basis`.
    cell : CellFacts or mapping.
    cycle : of the test: the share is of the capacity of that check-up. soc : stated at its start
        [1], or None.
    settings : `settings.FastCharge`, or its key as keyword: minutes [min].

    Returns
    -------
    charge : Result with one row, as of stage `fast_charge`: charge [Ah], shares [1].

    Raises
    ------
    Refusal : No upper cut-off, or no charge of at least 2 % of the capacity.

    Source: docs/fast-charge.md.
    """
    from cellwright.protocols.fast_charge import fast_charge as charged
    from cellwright.records.basis import at_cycle

    facts = inputs.cell_facts(cell)
    charge, notes = charged(
        inputs.columns(series, *inputs.COUNTED),
        inputs.steps(steps),
        capacity_ampere_hour=at_cycle(inputs.basis(basis), cycle)["capacity_ampere_hour"],
        rated_capacity_ampere_hour=facts.rated_capacity_ampere_hour,
        lower_cutoff_volt=facts.lower_cutoff_volt,
        upper_cutoff_volt=facts.upper_cutoff_volt,
        soc_at_start=soc,
        **inputs.settings_of(FastCharge, settings, changes)._asdict(),
    )
    return results.Result({"rows": [charge]}, notes=tuple(notes))


def ageing_cycles(series, steps, test, cell, course=None):
    """Complete cycles of one ageing record: capacity, energy, efficiency, temperature.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    test, cell : TestFacts (its `cycle` is that of the first), CellFacts or mappings.
    course : result of `course`: how the test before left the cell.

    Returns
    -------
    cycles : Result; rows: `protocols.ageing.AgeingCycles`, (k,): [Ah], [Wh], [1], [°C]; left_out:
        for each reason how many half cycles were left out, and which.

    Raises
    ------
    Refusal : No complete cycle.

    Source: docs/ageing.md.
    """
    from cellwright.protocols.ageing import ageing_cycles as cycles

    facts = inputs.cell_facts(cell)
    complete = cycles(
        inputs.columns(series, *inputs.COUNTED),
        inputs.steps(steps),
        first_cycle=inputs.test_facts(test).cycle or 0.0,
        rated_capacity_ampere_hour=facts.rated_capacity_ampere_hour,
        lower_cutoff_volt=facts.lower_cutoff_volt,
        upper_cutoff_volt=facts.upper_cutoff_volt,
        **_before(course, test),
    )
    left_out = tuple(complete.left_out)
    notes = (*left_out, *complete.by_rest)
    return results.Result({"rows": complete.rows}, {"left_out": left_out}, notes)
