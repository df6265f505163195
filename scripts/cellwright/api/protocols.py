"""Analyses of one test: capacity, OCV, pulses, rests, dQ/dV, impedance, fast charge, ageing."""

import numpy as np

from cellwright.api import inputs, results
from cellwright.settings import (
    FastCharge,
    Ica,
    Impedance,
    Instrument,
    Ocv,
    Relaxation,
    Resistance,
)

OCV = Ocv()
ICA = Ica()


def course(tests, cell):
    """The tests of one cell in time: which came before each, and whether it left the cell full.

    tests : (test, series, result of `segment`) each.

    Returns rows: columns, one entry a test: test_before, hour_between [h],
    state_at_begin ("full", "empty" or "" where not known) and words. Raises Refusal: a cut-off is
    not stated, so that no end of a test can be told. Source: docs/capacity.md.
    """
    from cellwright.protocols.course import course as course_of
    from cellwright.protocols.course import ends_of_test
    from cellwright.refusal import Refusal

    # A cell left full or empty is what anchors the SoC of a test that starts at rest.
    known = inputs.ratings(cell)
    limits = inputs.cutoffs(cell)
    if None in limits.values():
        raise Refusal("a cut-off is not stated, so whether a test ends full or empty is not known")
    ends = []
    for test, series, steps in tests:
        name, columns = inputs.test_facts(test).test, inputs.columns(series, *inputs.COUNTED)
        ends.append(ends_of_test(name, columns, inputs.steps(steps), **known))
    return results.Result({"rows": course_of(ends, **limits)})


def _before(course, test):
    """State in which the test before left the cell, by the result of `course` ("" where none), and
    the SoC at the start that the sheet states [1], or None."""
    rows = inputs.rows(course) if course is not None else []
    facts = inputs.test_facts(test) if test is not None else None
    name, soc = (None, None) if facts is None else (facts.test, facts.soc)
    state = next((row["state_at_begin"] for row in rows if row["test"] == name), "")
    return {"state_before": state, "soc_at_start": soc}


def capacity(
    series,
    steps,
    cell,
    settings=None,
    *,
    whole_swing=False,
    test=None,
    course=None,
    curves=(),
    **changes,
):
    """Capacities [Ah] of the complete charges and discharges of one test.

    settings : `settings.Instrument`.
    whole_swing : a half cycle that ends short of the cut-off counts too, as in slow OCV tests.
    curves : list of dict, open-circuit voltages of the cell that a stated SoC is held against.

    Returns rows: columns (k,): charge [Ah], energy [Wh], rate [1/h],
    efficiency [1]; half cycles left out are in the notes. Raises Refusal: no complete charge or
    discharge. Source: docs/capacity.md.
    """
    from cellwright.protocols.capacity import capacity as capacities
    from cellwright.records.basis import curve_at

    columns = inputs.columns(series, *inputs.COUNTED)
    # The OCV moves by tenths of a mV/K: the curve of the nearest temperature errs least.
    celsius = None if test is None else inputs.test_facts(test).ambient_temperature_celsius
    half_cycles = capacities(
        *inputs.quantities(columns, inputs.COUNTED),
        inputs.steps(steps),
        logged_current_ampere=columns.get("logged_current_ampere"),
        surface_temperature_celsius=columns.get("surface_temperature_celsius"),
        whole_swing=whole_swing,
        curve=curve_at(curves, celsius) if curves else None,
        doubt=columns.get("doubt"),
        ambient_temperature_celsius=celsius,
        **inputs.ratings(cell),
        **_before(course, test),
        **inputs.settings_of(Instrument, settings, changes)._asdict(),
    )
    return results.Result({"rows": half_cycles.rows}, notes=tuple(half_cycles.left_out))


def ocv(series, cell, *, least_hour=OCV.least_hour, test=None, course=None):
    """Open-circuit voltage [V] over SoC of one slow test: a curve, and functions fitted to it.

    least_hour : shortest charge or discharge that is slow enough [h].
    test : for its SoC at the start, or None. course : result of `course`, or None.

    Returns curve, `protocols.ocv.slow.OcvCurve` over SoC; functions: `OcvFunction` each. Raises
    Refusal: no charge or discharge is slow enough or complete. Source: docs/ocv.md.
    """
    from cellwright.protocols.ocv.functions import fit_functions
    from cellwright.protocols.ocv.slow import slow_ocv

    columns = inputs.columns(series, *inputs.COUNTED)
    curve = slow_ocv(
        *inputs.quantities(columns, inputs.COUNTED),
        file_index=columns.get("file_index"),
        least_hour=least_hour,
        **_before(course, test),
        **inputs.cutoffs(cell),
    )
    tables = {"curve": curve, "functions": fit_functions(curve.soc, curve.ocv_volt)}
    return results.Result(tables, notes=tuple(filter(None, [curve.note])))


def ocv_from_rests(
    series, steps, cell, test, capacities=(), *, rest_second=OCV.rest_second, course=None
):
    """Open-circuit voltage [V] over SoC from the rests of a pulse test.

    rest_second : shortest rest that is a point of the curve [s].

    Returns curve over SoC as of `ocv`; points: dict of (k,) columns, one entry a rest. Raises
    Refusal: no capacity, or too few rests. Source: docs/ocv.md.
    """
    from cellwright.protocols.ocv.rests import ocv_of_rests, rest_points, soc_at
    from cellwright.records.anchor import rest_scale

    test, steps = inputs.test_facts(test), inputs.steps(steps)
    columns = inputs.quantities(series, inputs.COUNTED)
    # Pulse tests rarely end at the lower cut-off: full comes from the record or the test before
    # it, the capacity from the discharges of the cell near this temperature and cycle.
    scale = rest_scale(
        *columns[1:],
        steps,
        inputs.entries(capacities),
        state_of_health=inputs.cell_facts(cell).state_of_health,
        ambient_temperature_celsius=test.ambient_temperature_celsius,
        cycle=test.cycle,
        **inputs.ratings(cell),
        **_before(course, test),
    )
    points = rest_points(*columns, steps, rest_second=rest_second)
    curve = ocv_of_rests(points, scale, **inputs.cutoffs(cell))
    table = points._asdict() | {"soc": soc_at(points, scale)}
    words = {"capacity_source": scale.source}
    return results.Result({"curve": curve, "points": table}, words, (curve.note,))


def chamber_steps(series, steps, basis, test, cell):
    """Shifts [V] of the open-circuit voltage in rests while the chamber temperature steps.

    series : with surface_temperature_celsius [°C].

    Returns rows, one a plateau: shift [V] and its uncertainty, temperatures [°C], SoC [1]. Raises
    Refusal: no rest with two steady temperatures. Source: thesis 3.3; docs/charge-temperature.md.
    """
    from cellwright.api.charge import state_of_charge
    from cellwright.protocols.ocv.steps import cell_temperature, chamber_shifts

    # The shift of the OCV by temperature changes its sign over SoC, so that must be known.
    columns, anchored = inputs.columns(series), state_of_charge(series, basis, test, cell)
    shifts = chamber_shifts(
        *inputs.quantities(columns, ("test_time_second", "voltage_volt")),
        cell_temperature(columns),
        anchored.soc,
        inputs.steps(steps),
    )
    notes = (f"SoC: {anchored.anchor}", *shifts.left_out)
    return results.Result({"rows": shifts.rows}, notes=notes)


def resistance(
    series, steps, basis, test, cell, settings=None, *, repeats=None, instrument=None, **changes
):
    """Resistance [ohm] at stated delays into each pulse of one test.

    settings : `settings.Resistance`, its key delay_second [s]. instrument : `settings.Instrument`.

    Returns rows, `protocols.resistance.ResistanceRows`, (k,): resistance_ohm and its standard
    deviation [ohm] by SoC [1], direction and delay [s]; SoC is NaN where not known. Raises Refusal:
    the record has no pulse from a rest, or none that can be read. Source: docs/resistance.md.
    """
    from cellwright.api.charge import state_of_charge
    from cellwright.protocols.resistance import pulse_resistance

    # Where SoC cannot be known the pulses count nevertheless: their SoC is then NaN.
    anchored = state_of_charge(series, basis, test, cell)
    shares = inputs.settings_of(Instrument, instrument, {})
    pulses = pulse_resistance(
        *inputs.quantities(series),
        anchored.soc,
        inputs.steps(steps),
        elsewhere=inputs.elsewhere(repeats, test, steps),
        doubt=inputs.columns(series).get("doubt"),
        against_soc=anchored.contradicted,
        logged_current_ampere=inputs.columns(series).get("logged_current_ampere"),
        rated_capacity_ampere_hour=inputs.basis(basis)["capacity_ampere_hour"],
        current_accuracy_share=shares.current_accuracy_share,
        **inputs.settings_of(Resistance, settings, changes)._asdict(),
    )
    notes = (f"SoC: {anchored.anchor}", *pulses.left_out)
    return results.Result({"rows": pulses.rows}, notes=notes)


def relaxation(series, steps, basis, test, cell, settings=None, *, repeats=None, **changes):
    """Two exponentials fitted to the voltage of each rest of one test: amplitudes, time constants.

    settings : `settings.Relaxation`.

    Returns rows, `protocols.rests.RestRows`, (k,): amplitudes [V], time constants [s] and their
    uncertainty; curve: voltage over time of one rest. Raises Refusal: no rest after a load is long
    enough. Source: thesis 3.3; docs/relaxation.md.
    """
    from cellwright.api.charge import state_of_charge
    from cellwright.protocols.rests import (
        chamber_or_cell,
        diffusion_in_words,
        example,
        rests_of,
    )
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
    # What a rest tells does not need the SoC: its origin is a note only where it is in doubt.
    stated = inputs.test_facts(test).soc is not None
    doubted = np.isnan(anchored.soc).all() or (stated and not anchored.anchor.startswith(AS_STATED))
    where = [f"SoC: {anchored.anchor}"] if doubted else []
    where += filter(None, [diffusion_in_words(rests.rows)])
    tables = {"rows": rests.rows, "curve": example(rests.rows, time, voltage)}
    return results.Result(tables, notes=(*where, *rests.left_out))


def ica(series, steps, *, direction="charge"):
    """Incremental capacity dQ/dV [Ah/V] over voltage of the constant-current charge in one test.

    Parts of a charge that was interrupted are one, as the notes say.

    direction : "discharge" for that of the discharge, which is read as its mirror image: charge and
        dQ/dV count from its lowest voltage, as those of a charge do.

    Returns curve, `protocols.ica.curve.IncrementalCapacity` [Ah/V] over voltage [V]; its c_rate
    [1/h]. Raises Refusal: no constant-current charge, or one over too small a voltage.
    Source: docs/ica.md.
    """
    from cellwright.protocols.ica.charge import charge_slope, constant_current_charge, constant_rows
    from cellwright.protocols.ica.discharge import mirrored
    from cellwright.protocols.ica.parts import parts_joined
    from cellwright.refusal import Refusal

    if direction not in ("charge", "discharge"):
        raise Refusal(f'direction is {direction!r}, wanted "charge" or "discharge"')
    of_steps, columns = inputs.steps(steps)._asdict(), inputs.quantities(series, inputs.COUNTED)
    turned, half = direction == "discharge", {"half": direction}
    time, current, voltage, charge = columns
    if turned:
        (time, current, voltage, charge), of_steps = mirrored(columns, of_steps)
    *ends, step = constant_current_charge(of_steps, charge, **half)
    ends = constant_rows(current, *ends)
    rows, notes = parts_joined(time, current, voltage, charge, of_steps, step, ends, **half)
    # The end of a discharge is where its voltage, and what it has left, is lowest.
    order, sign = (rows[::-1], -1.0) if turned else (rows, 1.0)
    curve, slope = charge_slope(sign * voltage[order], sign * charge[order], **half)
    # The mean current of a step that holds the voltage in the end is less than its constant one.
    rated = of_steps["current_mean_ampere"][step] / of_steps["c_rate"][step]
    about = {"c_rate": float(np.median(current[rows]) / rated), "slope": slope}
    return results.Result({"curve": curve}, about, tuple(notes))


def ica_discharge(series, steps, *, prominence=ICA.prominence, slow=False):
    """Incremental capacity of the slow discharge in one test, and its peaks, beside its charge.

    prominence : as of `ica_peaks`. slow : whether any discharge of the test counts as slow, as in a
        test for the open-circuit voltage; else one no faster than the charge in it.

    Returns rows and curve as of `ica_peaks` and `ica`, without an entry where the test has no such
    discharge, as the notes say. Source: docs/ica.md.
    """
    from cellwright.protocols.ica.discharge import NO_CURVE, NO_PEAKS, refuse_faster
    from cellwright.refusal import Refusal

    try:
        found = ica(series, steps, direction="discharge")
        if not slow:
            refuse_faster(found.c_rate, inputs.steps(steps))
        peaks = ica_peaks(found, prominence=prominence)
    except Refusal as refusal:
        notes = (f"no dQ/dV of a discharge: {refusal}",)
        return results.Result({"rows": NO_PEAKS, "curve": NO_CURVE}, {"c_rate": np.nan}, notes)
    return results.Result(
        {"rows": peaks.rows, "curve": found.curve}, {"c_rate": found.c_rate}, found.notes
    )


def ica_peaks(ica, *, prominence=ICA.prominence):
    """Peaks of the incremental capacity of one charge: voltage [V], height [Ah/V], area [Ah].

    ica : result of `ica`.
    prominence : least rise of a peak, as a share of the highest dQ/dV [1].

    Returns rows, (k,): voltage [V], height [Ah/V], area [Ah], width [V], each with its standard
    deviation; doubt: where the charge was interrupted, and where its curve ends for another reason
    than the charge itself. Raises Refusal: no peaks. Source: docs/ica.md.
    """
    from cellwright.protocols.ica.charge import charge_peaks

    rows = charge_peaks(ica.slope, c_rate=ica.c_rate, prominence=prominence)
    rows["doubt"] = np.full(len(rows["peak"]), "; ".join(ica.notes))
    return results.Result({"rows": rows})


def ica_life(series, steps, cycles, *, prominence=ICA.prominence, most=30):
    """Peaks of dQ/dV of charges spread evenly over one ageing record.

    cycles : result of `ageing_cycles`, or its columns.
    prominence : as of `ica_peaks`. most : charges at most.

    Returns rows, one a peak; curves: columns cycle, voltage [V], dQ/dV [Ah/V]. Raises Refusal: no
    complete charge, or none whose dQ/dV can be taken. Source: docs/ica.md.
    """
    from cellwright.protocols.ica.life import peaks_of_life

    record = inputs.quantities(series, inputs.COUNTED)
    columns = inputs.columns(cycles, "cycle", "direction", "start_time_second")
    steps = inputs.steps(steps)._asdict()
    how = {"prominence": prominence, "most": most}
    rows, curves, notes = peaks_of_life(*record, steps, columns, **how)
    return results.Result({"rows": rows, "curves": curves}, notes=tuple(notes))


SPECTRUM = ("frequency_hertz", "impedance_real_ohm", "impedance_imaginary_ohm")


def spectra_together(spectra, settings=None, **changes):
    """Circuit that all spectra of a cell prefer, and its arc of charge transfer in each of them.

    spectra : (test, spectrum) each, spectra as in `impedance`; of the tests count SoC, temperature
        and cycle. One that `impedance` refuses takes no part.
    settings : `settings.Impedance`.

    Returns rows, one a test and circuit, for `impedance`. Raises Refusal: no spectrum can be used.
    Source: docs/impedance.md.
    """
    from cellwright.protocols.impedance import follow
    from cellwright.protocols.impedance.analysis import trusted_spectrum
    from cellwright.protocols.impedance.circuits import parse_constraints
    from cellwright.refusal import Refusal

    choice = inputs.settings_of(Impedance, settings, changes)._asdict()
    inductance = choice.pop("inductance")
    taken, notes = [], []
    for test, spectrum in spectra:
        about = inputs.test_facts(test)
        made_at = {
            "celsius": about.ambient_temperature_celsius,
            "soc": about.soc,
            "cycle": about.cycle,
        }
        try:
            one = trusted_spectrum(*_complex(spectrum)[:2], inductance=inductance, **made_at)[0]
        except Refusal as refusal:
            notes.append(f"{about.test} takes no part: {refusal}")
        else:
            taken.append((about.test, one))
    if not taken:
        raise Refusal("; ".join(notes) or "there is no spectrum")
    fixed, tied = parse_constraints(choice.pop("constraints"))
    followed = follow([one for _, one in taken], **choice, fixed=fixed, tied=tied)
    rows = [
        {"test": test} | row
        for (test, _), rows in zip(taken, followed, strict=True)
        for row in rows
    ]
    return results.Result({"rows": rows}, notes=tuple(notes))


def impedance(spectrum, settings=None, *, cell=None, doubt="", test=None, together=None, **changes):
    """One spectrum analysed: Kramers-Kronig test, circuit fit, distribution of relaxation times.

    spectrum : DataFrame or columns: frequency_hertz [Hz], impedance_real_ohm and
        impedance_imaginary_ohm [ohm], (n,) each.
    settings : `settings.Impedance`. cell : its rating is held against the impedance; None: it is
        not. doubt : what its file says against it, as `read` gives it.
    together : result of `spectra_together` or its rows, among them those of `test`; None: the
        spectrum stands alone.

    Raises Refusal: an unknown circuit, too few points, or none that can be trusted; `test` is not
    among the spectra together. Source: thesis 3.2; docs/impedance.md.
    """
    from cellwright.protocols.impedance import analyse

    frequency, ohm, columns = _complex(spectrum)
    analysis = analyse(
        frequency,
        ohm,
        temperature_celsius=columns.get("surface_temperature_celsius"),
        rated_capacity_ampere_hour=None if cell is None else inputs.rating(cell),
        together=None if together is None else _of_test(together, test),
        **inputs.settings_of(Impedance, settings, changes)._asdict(),
    )
    # The row is the table of the step; curves of fit, test and distribution stand beside it.
    found = analysis._asdict()
    row = found.pop("row")
    row["doubt"] = "; ".join(filter(None, (doubt, row["doubt"])))
    tables = {"rows": [row], **found}
    return results.Result(tables, notes=tables.pop("notes"))


def _complex(spectrum):
    """Frequency (n,) [Hz], impedance (n,) complex [Ω] and all columns of a spectrum."""
    columns = inputs.columns(spectrum, *SPECTRUM)
    frequency, real, imaginary = (columns[name] for name in SPECTRUM)
    # The imaginary part has its sign: capacitive arcs are negative.
    return frequency, real + 1j * imaginary, columns


def _of_test(together, test):
    """Rows of one test among the spectra together."""
    from cellwright.refusal import Refusal

    rows = inputs.rows(together)
    name = None if test is None else inputs.test_facts(test).test
    found = [row for row in rows if row["test"] == name]
    if not found:
        known = ", ".join(dict.fromkeys(row["test"] for row in rows))
        raise Refusal(f"no spectrum {name} among those together: {known}; `test` names it")
    return found


def thermometer(spectra, series):
    """Offset [K] between the temperature in a cell's spectra and that of its other records at rest.

    spectra : (test, result of `impedance`, or its row) each. series : (test, series) each.

    Returns rows, one a chamber temperature: the offset [K], NaN without either reading.
    Source: docs/impedance.md.
    """
    from cellwright.protocols.impedance.trust import rested_temperature, temperature_offsets

    def around(test):
        return inputs.test_facts(test).ambient_temperature_celsius

    read = [
        (around(test), inputs.rows(getattr(entry, "rows", [entry]))[0]["temperature_celsius"])
        for test, entry in spectra
    ]
    # Of spectra the instrument's reading, of series that at rest, when the cell is as warm as the
    # chamber: what differs is the thermometer, and would shift every law over temperature.
    names = ("test_time_second", "current_ampere", "surface_temperature_celsius")
    at_rest = [
        (around(test), rested_temperature(*[inputs.columns(entry).get(name) for name in names]))
        for test, entry in series
    ]
    rows, notes = temperature_offsets(read, at_rest)
    return results.Result({"rows": rows}, notes=tuple(notes))


def fast_charge(series, steps, basis, cell, settings=None, *, cycle=None, soc=None, **changes):
    """Share of the capacity [1] that a fast charge reaches in its minutes, and what limits it.

    cycle : of the test: the share is of the capacity of that check-up.
    soc : stated at its start [1], or None.
    settings : `settings.FastCharge`, its key minutes [min].

    Returns one row, as of stage `fast_charge`: charge [Ah], shares [1]. Raises Refusal: no
    upper cut-off, or no charge of at least 2 % of the capacity. Source: docs/charge-temperature.md.
    """
    from cellwright.protocols.fast_charge import fast_charge as charged
    from cellwright.records.basis import at_cycle

    charge, notes = charged(
        inputs.columns(series, *inputs.COUNTED),
        inputs.steps(steps),
        # An aged cell is full with less charge: its share is of what it holds then.
        capacity_ampere_hour=at_cycle(inputs.basis(basis), cycle)["capacity_ampere_hour"],
        soc_at_start=soc,
        **inputs.ratings(cell),
        **inputs.settings_of(FastCharge, settings, changes)._asdict(),
    )
    return results.Result({"rows": [charge]}, notes=tuple(notes))


def ageing_cycles(series, steps, test, cell, course=None, instrument=None):
    """Complete cycles of one ageing record: capacity, energy, efficiency, temperature.

    test : its `cycle` is that of the first. instrument : `settings.Instrument`.

    Returns rows, `protocols.ageing.AgeingCycles`, (k,): [Ah], [Wh], [1], [°C]; left_out: for each
    reason how many half cycles were left out, and which. Raises Refusal: no complete cycle.
    Source: docs/health.md.
    """
    from cellwright.protocols.ageing import ageing_cycles as cycles

    complete = cycles(
        inputs.columns(series, *inputs.COUNTED),
        inputs.steps(steps),
        # A record counts its own cycles; the sheet says how many came before it.
        first_cycle=inputs.test_facts(test).cycle or 0.0,
        **inputs.ratings(cell),
        **_before(course, test),
        **inputs.settings_of(Instrument, instrument, {})._asdict(),
    )
    left_out = tuple(complete.left_out)
    notes = (*left_out, *complete.by_rest)
    return results.Result({"rows": complete.rows}, {"left_out": left_out}, notes)


def disagreements(rows, *, quantity):
    """Rows of several tests, each with what the other tests of its cell say against it in `doubt`.

    rows : of `capacity` or `resistance`, with cell, test, cycle and ambient_temperature_celsius.
    quantity : "capacity" or "resistance".

    Returns rows. What cannot both be true of one cell of one age is told: a gain of the current or
    the clock shows in no record by itself. Source: docs/capacity.md.
    """
    from cellwright.records.agreement import with_disagreements

    return results.Result({"rows": with_disagreements(rows, quantity=quantity)})
