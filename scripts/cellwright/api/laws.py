"""Laws over temperature, SoC and rate, from the rows of many tests."""

from cellwright.api import inputs, results
from cellwright.settings import Models, Temperature

TEMPERATURE = Temperature()
MODELS = Models()


def temperature_laws(capacities=(), resistances=(), spectra=(), settings=None, **changes):
    """Laws of resistance and capacity of one cell over temperature: quadratic and Arrhenius.

    settings : `settings.Temperature`.

    Returns rows, one a parameter; points: what the laws were fitted to. Raises Refusal: no quantity
    is known at three temperatures. Source: thesis ch. 3; docs/temperature.md.
    """
    from cellwright.laws import points as measured

    options = inputs.settings_of(Temperature, settings, changes)
    sizes = measured.capacity_points(inputs.entries(capacities))
    circuits, vague = measured.impedance_points(inputs.entries(spectra))
    pulses, mixed = measured.resistance_points(inputs.entries(resistances), **options._asdict())
    # Two temperatures fit any law of two parameters exactly: only a third can contradict it. Of
    # several tests at one temperature the mean counts, lest the busiest one draw the law.
    points = measured.with_enough_temperatures([*sizes, *circuits, *pulses])
    return _fitted(measured.mean_per_temperature(points), (*vague, *mixed))


def _fitted(points, notes=()):
    """Result of the laws over temperature that are fitted to points."""
    from cellwright.laws.temperature import law_rows

    rows, reasons = law_rows(points)
    return results.Result({"rows": rows, "points": points}, notes=(*notes, *reasons))


def temperature_laws_of_type(resistances, settings=None, **changes):
    """Laws of pulse resistance over temperature across cells of one type.

    resistances : rows with cell too. settings : `settings.Temperature`.

    Returns rows and points as of `temperature_laws`. Raises Refusal: no quantity is known at three
    temperatures. Source: docs/temperature.md.
    """
    from cellwright.laws.of_type import points_of_type, sentences_of_type
    from cellwright.laws.points import with_enough_temperatures

    options = inputs.settings_of(Temperature, settings, changes)
    compared, left_out = points_of_type(inputs.rows(resistances), **options._asdict())
    # Points stay apart here: how cells differ is what the interval of the type's law tells.
    points = with_enough_temperatures(compared)
    return _fitted(points, (*left_out, *sentences_of_type(points)))


def fast_charge_laws(charges):
    """Laws of the fast charge of one cell over temperature.

    charges : rows of `fast_charge` with ambient_temperature_celsius, or (test, result) each.

    Returns rows as of `temperature_laws`; points: all that was measured. Raises Refusal: fewer than
    three temperatures. Source: docs/charge-temperature.md.
    """
    from cellwright.laws.points import fast_charge_points, with_enough_temperatures

    points = fast_charge_points(inputs.entries(charges))
    found = _fitted(with_enough_temperatures(points))
    # Quantities known at two temperatures only have no law, but are points all the same.
    return found._replace(tables=found.tables | {"points": points})


def cold_limit(laws, points=None):
    """A paragraph on the part of the resistance that limits a cell in the cold.

    laws : result of `temperature_laws`, or its rows. points : rows of its points; None: of `laws`.

    Returns content of `laws.cold.ColdLimit`. Raises Refusal: too few parts of the resistance were
    measured over temperature. Source: docs/temperature.md.
    """
    from cellwright.laws.cold import cold_limit as limited
    from cellwright.laws.points import Point

    points = inputs.rows(laws.points if points is None else points)
    return results.Result({}, limited([Point(**row) for row in points], inputs.rows(laws)))


def resistance_surface(resistances, *, delay_second=TEMPERATURE.delay_second):
    """Resistance [ohm] of one cell over SoC and temperature in three forms, and which fits best.

    delay_second : delays into the pulse [s].

    Returns rows: the laws; points: measured and fitted. Raises Refusal: too few pulses.
    Source: docs/temperature.md.
    """
    from cellwright.laws import surface

    rows = inputs.entries(resistances)
    # Temperatures left out of the fit choose the form: a table meets its own points best.
    fits, reasons = surface.surfaces(rows, delay_second=delay_second)
    tables = {"rows": surface.law_rows(fits), "points": surface.point_rows(fits)}
    return results.Result(tables, notes=(*reasons, *surface.sentences(fits)))


def polarisation_laws(rests):
    """Polarisation of one cell over SoC and temperature: amplitudes [V], time constants [s], laws.

    rests : rows of `relaxation` with ambient_temperature_celsius, or (test, result) each.

    Returns rows: the laws; points: without any where no rests compare, the reason in the notes.
    Source: thesis 3.3; docs/relaxation.md.
    """
    from cellwright.laws.polarisation import comparable_rests, law_rows, laws_of, paragraph

    found = comparable_rests(inputs.entries(rests))
    laws, reasons = laws_of(found.points)
    tables = {"rows": law_rows(laws), "points": found.points}
    return results.Result(tables, notes=(paragraph(found, laws), *reasons))


def ocv_over_temperature(curves=(), steps=()):
    """Open-circuit voltage [V] of one cell over SoC and temperature.

    curves : (test, result of `ocv`) each. steps : (test, result of `chamber_steps`) each.

    Returns rows: the laws; map, entropic, surface, functions. Raises Refusal: fewer than two
    temperatures. Source: thesis 3.1; docs/charge-temperature.md.
    """
    from cellwright.api.charge import curves_of
    from cellwright.laws.ocv import over_temperature as ocv

    # Slow curves err by their polarisation, which differs between temperatures; rests at stepped
    # temperatures are fewer. The surer of the two tells the entropic coefficient, both are tables.
    slow = inputs.entries(curves, curves_of)
    result = ocv.over_temperature(slow, inputs.entries(steps))
    tables = {
        "rows": ocv.law_rows(result),
        "map": ocv.map_columns(result),
        "entropic": ocv.entropic_columns(result),
        "surface": ocv.surface_columns(result),
        "functions": ocv.function_rows(result),
    }
    return results.Result(tables, notes=tuple(result.notes))


def ocv_shifts(tests):
    """Shift of the OCV [V] of a cell since its first check-up, from charges and discharges alike.

    tests : (test, series, result of `segment`) each, of capacity tests at several `cycle`s.

    Returns rows, one a later test and SoC: cycle, soc [1], shift_volt, shift_std_volt [V], test,
    reference_test. What cannot be compared is in the notes. Source: docs/state-of-charge.md.
    """
    from cellwright.protocols.ocv.shift import shifts_since_first

    records = []
    for test, series, steps in tests:
        facts, counted = inputs.test_facts(test), inputs.quantities(series, inputs.COUNTED)
        # A test without a stated cycle is of the fresh cell, with which the others are compared.
        records.append((facts.test, facts.cycle or 0.0, (*counted[1:], inputs.steps(steps))))
    rows, notes = shifts_since_first(records)
    return results.Result({"rows": rows}, notes=tuple(notes))


def capacity_loss(capacities):
    """Capacity of one cell lost to temperature and rate [%], split into true and false.

    Returns rows: the laws; points: one row a loss [%]. Raises Refusal: no slow test, or fewer than
    two comparable capacities. Source: thesis 4.2; docs/charge-temperature.md.
    """
    from cellwright.health.capacity_loss import capacity_losses, law_rows

    losses, notes = capacity_losses(inputs.entries(capacities))
    return results.Result({"rows": law_rows(losses), "points": losses}, notes=tuple(notes))


def ica_over_temperature(charges):
    """Peaks of incremental capacity of one cell, matched across temperatures.

    charges : `health.peaks.over_temperature.Charge` each, or (test, result of `ica`).

    Returns rows: the matches; peaks, curves. Raises Refusal: fewer than two temperatures.
    Source: docs/charge-temperature.md.
    """
    from cellwright.health.peaks.over_temperature import Charge, peaks_over_temperature

    def charge_of(charge):
        if isinstance(charge, Charge):
            return charge
        test, ica = inputs.test_facts(charge[0]), charge[1]
        curve = ica.curve.voltage_volt, ica.curve.dq_dv_ampere_hour_per_volt
        return Charge(test.test, test.ambient_temperature_celsius, ica.c_rate, *curve)

    rows, peaks, curves, notes = peaks_over_temperature(list(map(charge_of, charges)))
    tables = {"rows": rows, "peaks": peaks, "curves": curves}
    return results.Result(tables, notes=tuple(notes))


def ageing_over_temperature(cycles, test):
    """Fade, temperature and daily cycle of the capacities of one ageing record.

    cycles : result of `ageing_cycles`, or its columns.

    Returns cycles; rows: the laws; periodogram; content: summary. Raises Refusal: too few cycles.
    Source: docs/health.md.
    """
    from cellwright.health.ageing import cycle_temperature, law_rows
    from cellwright.protocols.ageing import AgeingCycles

    summary, compensated, periodogram = cycle_temperature(inputs.table_of(AgeingCycles, cycles))
    rows = law_rows(summary, test=inputs.test_facts(test).test)
    notes = tuple(filter(None, [summary["reason"]]))
    tables = {"cycles": compensated, "rows": rows, "periodogram": periodogram}
    return results.Result(tables, {"summary": summary}, notes)


def thermal_constants(cell, model, tests, *, split_rest_second=MODELS.split_rest_second):
    """Heat capacity and thermal resistance of a cell from tests with its logged temperature.

    tests : those of role fit with surface_temperature_celsius are fitted, those of role validation
        scored.

    Returns content: heat_capacity_joule_per_kelvin [J/K], resistance_kelvin_per_watt [K/W], their
    standard deviations, the entropic coefficient over SoC [V/K], or None and the reason; rows: one
    a test. Source: docs/temperature.md.
    """
    from cellwright.identification.thermal import thermal_of

    about = inputs.model(model), inputs.cell_facts(cell), inputs.tests(tests)
    content, rows, notes = thermal_of(*about, split_rest_second=split_rest_second)
    return results.Result({"rows": rows}, content, notes)
