"""Laws over temperature, SoC and rate, from the rows of many tests."""

from cellwright.api import inputs, results
from cellwright.settings import (
    CapacityLoss,
    IcaTemperature,
    Models,
    OcvTemperature,
    Temperature,
)

TEMPERATURE = Temperature()
MODELS = Models()


def temperature_laws(capacities=(), resistances=(), spectra=(), settings=None, **changes):
    """Laws of resistance and capacity of one cell over temperature: quadratic and Arrhenius.

    Parameters
    ----------
    capacities, resistances, spectra : rows of `capacity`, `resistance` and `impedance` with
        ambient_temperature_celsius and cycle: (test, result) each, or tables of them.
    settings : `settings.Temperature`, or its keys as keywords.

    Returns
    -------
    laws : Result; one row a parameter; points: what the laws were fitted to.

    Raises
    ------
    Refusal : No quantity is known at three temperatures.

    Source: thesis ch. 3; docs/temperature.md.
    """
    from cellwright.laws import points as measured
    from cellwright.laws.temperature import law_rows

    options = inputs.settings_of(Temperature, settings, changes)
    sizes = measured.capacity_points(_rows(capacities))
    circuits, vague = measured.impedance_points(_rows(spectra))
    pulses, mixed = measured.resistance_points(_rows(resistances), **options._asdict())
    points = measured.with_enough_temperatures([*sizes, *circuits, *pulses])
    points = measured.mean_per_temperature(points)
    rows, reasons = law_rows(points)
    notes = (*vague, *mixed, *reasons)
    return results.Result({"rows": rows, "points": points}, notes=notes)


def _rows(tables):
    """Rows of a table, or of (test, result) each, with the facts of their tests."""
    pairs = isinstance(tables, list | tuple) and not hasattr(tables, "_asdict")
    return inputs.entries(tables) if pairs else inputs.rows(tables)


def temperature_laws_of_type(resistances, settings=None, **changes):
    """Laws of pulse resistance over temperature across cells of one type.

    Parameters
    ----------
    resistances : rows of `resistance` with cell, ambient_temperature_celsius and cycle.
    settings : `settings.Temperature`, or its keys as keywords.

    Returns
    -------
    laws : Result.

    Raises
    ------
    Refusal : No quantity is known at three temperatures.

    Source: docs/temperature.md.
    """
    from cellwright.laws.of_type import points_of_type, sentences_of_type
    from cellwright.laws.points import with_enough_temperatures
    from cellwright.laws.temperature import law_rows

    options = inputs.settings_of(Temperature, settings, changes)
    compared, left_out = points_of_type(inputs.rows(resistances), **options._asdict())
    points = with_enough_temperatures(compared)
    rows, reasons = law_rows(points)
    notes = (*left_out, *sentences_of_type(points), *reasons)
    return results.Result({"rows": rows, "points": points}, notes=notes)


def fast_charge_laws(charges):
    """Laws of the fast charge of one cell over temperature.

    Parameters
    ----------
    charges : rows of `fast_charge` with ambient_temperature_celsius, or (test, result) each.

    Returns
    -------
    laws : Result.

    Raises
    ------
    Refusal : Fewer than three temperatures.

    Source: docs/fast-charge.md.
    """
    from cellwright.laws.points import fast_charge_points, with_enough_temperatures
    from cellwright.laws.temperature import law_rows

    points = fast_charge_points(_rows(charges))
    rows, reasons = law_rows(with_enough_temperatures(points))
    return results.Result({"rows": rows, "points": points}, notes=tuple(reasons))


def cold_limit(laws, points=None):
    """A paragraph on the part of the resistance that limits a cell in the cold.

    Parameters
    ----------
    laws : result of `temperature_laws`, or its rows. points : rows of its points; None: of `laws`.

    Returns
    -------
    limit : Result.

    Raises
    ------
    Refusal : Too few parts of the resistance were measured over temperature.

    Source: docs/temperature.md.
    """
    from cellwright.laws.cold import cold_limit as limited
    from cellwright.laws.points import Point

    points = inputs.rows(laws.points if points is None else points)
    return results.Result({}, limited([Point(**row) for row in points], inputs.rows(laws)))


def resistance_surface(
    resistances, *, delay_second=TEMPERATURE.delay_second, c_rate=TEMPERATURE.c_rate
):
    """Resistance [ohm] of one cell over SoC and temperature in three forms, and which fits best.

    Parameters
    ----------
    resistances : rows of `resistance` with ambient_temperature_celsius and cycle, or (test,
        result) each.
    delay_second : delays into the pulse [s].
    c_rate : preferred rate of the pulses [1/h].

    Returns
    -------
    laws : Result; points: measured and fitted.

    Raises
    ------
    Refusal : Too few pulses.

    Source: docs/resistance-surface.md.
    """
    from cellwright.laws import surface

    fits, reasons = surface.surfaces(_rows(resistances), delay_second=delay_second, c_rate=c_rate)
    notes = (*reasons, *surface.sentences(fits))
    tables = {"rows": surface.law_rows(fits), "points": surface.point_rows(fits)}
    return results.Result(tables, notes=notes)


def polarisation_laws(rests):
    """Polarisation of one cell over SoC and temperature: amplitudes [V], time constants [s], laws.

    Parameters
    ----------
    rests : rows of `relaxation` with ambient_temperature_celsius, or (test, result) each.

    Returns
    -------
    laws : Result; without points where no rests compare, the reason in its notes.

    Source: thesis 3.3; docs/relaxation.md.
    """
    from cellwright.laws.polarisation import comparable_rests, law_rows, laws_of, paragraph

    found = comparable_rests(_rows(rests))
    laws, reasons = laws_of(found.points)
    tables = {"rows": law_rows(laws), "points": found.points}
    return results.Result(tables, notes=(paragraph(found, laws), *reasons))


def ocv_over_temperature(curves=(), steps=(), settings=None, **changes):
    """Open-circuit voltage [V] of one cell over SoC and temperature.

    Parameters
    ----------
    curves : (test, result of `ocv`) each. steps : (test, result of `chamber_steps`) each.
    settings : `settings.OcvTemperature`, or its keys as keywords.

    Returns
    -------
    map : Result.

    Raises
    ------
    Refusal : Fewer than two temperatures.

    Source: thesis 3.1; docs/ocv-temperature.md.
    """
    from cellwright.api.charge import _curves
    from cellwright.laws.ocv import over_temperature as ocv

    chosen = inputs.settings_of(OcvTemperature, settings, changes)
    slow = inputs.entries(curves, _curves)
    result = ocv.over_temperature(slow, inputs.entries(steps), **chosen._asdict())
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

    Parameters
    ----------
    tests : (test, clean series, result of `segment`) each, of capacity tests at several `cycle`s.

    Returns
    -------
    shifts : Result; one row a later test and SoC: cycle, soc [1], shift_volt, shift_std_volt [V],
        test, reference_test. What cannot be compared is in the notes.

    Source: docs/state-of-charge.md.
    """
    from cellwright.protocols.ocv.shift import shifts_since_first

    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    records = [
        (
            inputs.test_facts(test).test,
            inputs.test_facts(test).cycle or 0.0,
            (*inputs.quantities(series, names), inputs.steps(steps)),
        )
        for test, series, steps in tests
    ]
    rows, notes = shifts_since_first(records)
    return results.Result({"rows": rows}, notes=tuple(notes))


def capacity_loss(capacities, settings=None, **changes):
    """Capacity of one cell lost to temperature and rate [%], split into true and false.

    Parameters
    ----------
    capacities : rows of `capacity` with test, ambient_temperature_celsius and cycle, or (test,
        result) each.
    settings : `settings.CapacityLoss`, or its keys as keywords.

    Returns
    -------
    losses : Result; points: one row a loss [%].

    Raises
    ------
    Refusal : No slow test, or fewer than two comparable capacities.

    Source: thesis 4.2; docs/capacity-loss.md.
    """
    from cellwright.health.capacity_loss import capacity_losses, law_rows

    options = inputs.settings_of(CapacityLoss, settings, changes)
    losses, notes = capacity_losses(_rows(capacities), **options._asdict())
    return results.Result({"rows": law_rows(losses), "points": losses}, notes=tuple(notes))


def ica_over_temperature(charges, settings=None, **changes):
    """Peaks of incremental capacity of one cell, matched across temperatures.

    Parameters
    ----------
    charges : `health.peaks.over_temperature.Charge` each, or (test, result of `ica`).
    settings : `settings.IcaTemperature`, or its keys as keywords.

    Returns
    -------
    matches : Result.

    Raises
    ------
    Refusal : Fewer than two temperatures.

    Source: docs/ica-temperature.md.
    """
    from cellwright.health.peaks.over_temperature import peaks_over_temperature

    options = inputs.settings_of(IcaTemperature, settings, changes)
    rows, peaks, curves, notes = peaks_over_temperature(
        [_charge(charge) for charge in charges], **options._asdict()
    )
    tables = {"rows": rows, "peaks": peaks, "curves": curves}
    return results.Result(tables, notes=tuple(notes))


def _charge(charge):
    """`health.peaks.over_temperature.Charge` as it is, or made of (test, result of `ica`)."""
    from cellwright.health.peaks.over_temperature import Charge

    if isinstance(charge, Charge):
        return charge
    test, ica = inputs.test_facts(charge[0]), charge[1]
    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    curve = [getattr(ica.curve, name) for name in names]
    return Charge(test.test, test.ambient_temperature_celsius, ica.c_rate, *curve)


def ageing_over_temperature(cycles, test):
    """Fade, temperature and daily cycle of the capacities of one ageing record.

    Parameters
    ----------
    cycles : result of `ageing_cycles`. test : TestFacts or mapping.

    Returns
    -------
    laws : Result.

    Raises
    ------
    Refusal : Too few cycles.

    Source: docs/ageing.md.
    """
    from cellwright.health.ageing import cycle_temperature, law_rows
    from cellwright.protocols.ageing import AgeingCycles

    table = getattr(cycles, "rows", cycles)
    if not isinstance(table, AgeingCycles):
        table = AgeingCycles(**inputs.columns(table, *AgeingCycles._fields))
    summary, compensated, periodogram = cycle_temperature(table)
    rows = law_rows(summary, test=inputs.test_facts(test).test)
    notes = tuple(filter(None, [summary["reason"]]))
    tables = {"cycles": compensated, "rows": rows, "periodogram": periodogram}
    return results.Result(tables, {"summary": summary}, notes)


def thermal_constants(cell, model, tests, *, split_rest_second=MODELS.split_rest_second):
    """Heat capacity and thermal resistance of a cell from tests with its logged temperature.

    Parameters
    ----------
    cell : CellFacts or mapping. model : of the cell.
    tests : (test, clean series) each; those of role fit with surface_temperature_celsius are
        fitted, those of role validation scored.
    split_rest_second : shortest rest that cuts a test of role split into blocks [s].

    Returns
    -------
    thermal : Result; content: heat_capacity_joule_per_kelvin [J/K], resistance_kelvin_per_watt
        [K/W], their standard deviations, the entropic coefficient over SoC [V/K], or None and the
        reason; its table: one row a test.

    Source: docs/thermal.md.
    """
    from cellwright.identification.thermal import thermal_of

    about = inputs.model(model), inputs.cell_facts(cell), inputs.tests(tests)
    found = thermal_of(*about, split_rest_second=split_rest_second)
    return results.Result({"rows": found.rows}, found.content, found.notes)
