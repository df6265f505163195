"""Laws over temperature, SoC and rate, from the rows of many tests."""

from cellwright.settings import (
    Ageing,
    CapacityLoss,
    IcaTemperature,
    OcvTemperature,
    Temperature,
)

TEMPERATURE = Temperature()


def temperature_laws(capacities=(), resistances=(), spectra=(), settings=None, **changes):
    """Resistance and capacity of one cell over temperature: quadratic and Arrhenius.

    Parameters
    ----------
    capacities, resistances, spectra : rows of `capacity`, `resistance` and `impedance` with
        ambient_temperature_celsius and cycle: (test, result) each, or tables of them.
    settings : `settings.Temperature`, or its keys as keywords.

    Returns
    -------
    laws : Laws; one row a parameter; points: what the laws were fitted to.

    Raises
    ------
    Refusal
        No quantity is known at three temperatures.

    Source: thesis ch. 3; docs/temperature.md.
    """
    from cellwright.api import given, results
    from cellwright.laws import points as measured
    from cellwright.laws.temperature import law_rows

    chosen = given.chosen(Temperature, settings, changes)
    sizes = measured.capacity_points(_rows(capacities))
    circuits = measured.impedance_points(_rows(spectra))
    pulses = measured.resistance_points(_rows(resistances), **chosen._asdict())
    points = measured.with_enough_temperatures([*sizes, *circuits.points, *pulses.points])
    points = measured.mean_per_temperature(points)
    rows, reasons = law_rows(points)
    return results.Laws(rows, points, (*circuits.notes, *pulses.notes, *reasons))


def _rows(tables):
    """Rows of a table, or of (test, result) each, with the facts of their tests."""
    from cellwright.api import given

    pairs = isinstance(tables, list | tuple) and not hasattr(tables, "_asdict")
    return given.entries(tables) if pairs else given.rows(tables)


def temperature_laws_of_type(resistances, settings=None, **changes):
    """Pulse resistance over temperature across cells of one type.

    Parameters
    ----------
    resistances : rows of `resistance` with cell, ambient_temperature_celsius and cycle.
    settings : `settings.Temperature`, or its keys as keywords.

    Returns
    -------
    laws : Laws.

    Raises
    ------
    Refusal
        No quantity is known at three temperatures.

    Source: docs/temperature.md.
    """
    from cellwright.api import given, results
    from cellwright.laws.of_type import points_of_type, sentences_of_type
    from cellwright.laws.points import with_enough_temperatures
    from cellwright.laws.temperature import law_rows

    chosen = given.chosen(Temperature, settings, changes)
    found = points_of_type(given.rows(resistances), **chosen._asdict())
    points = with_enough_temperatures(found.points)
    rows, reasons = law_rows(points)
    return results.Laws(rows, points, (*found.notes, *sentences_of_type(points), *reasons))


def fast_charge_laws(charges):
    """Fast charge of one cell over temperature.

    Parameters
    ----------
    charges : rows of `fast_charge` with ambient_temperature_celsius, or (test, result) each.

    Returns
    -------
    laws : Laws.

    Raises
    ------
    Refusal
        Fewer than three temperatures.

    Source: docs/fast-charge.md.
    """
    from cellwright.api import results
    from cellwright.laws.points import fast_charge_points, with_enough_temperatures
    from cellwright.laws.temperature import law_rows

    points = fast_charge_points(_rows(charges))
    rows, reasons = law_rows(with_enough_temperatures(points))
    return results.Laws(rows, points, tuple(reasons))


def cold_limit(laws, points=None):
    """What limits a cell in the cold, in words.

    Parameters
    ----------
    laws : result of `temperature_laws`, or its rows. points : rows of its points, None: its own.

    Returns
    -------
    limit : Document.

    Raises
    ------
    Refusal
        Too few parts of the resistance were measured over temperature.

    Source: docs/temperature.md.
    """
    from cellwright.api import given, results
    from cellwright.laws.cold import cold_limit as limited
    from cellwright.laws.points import Point

    points = given.rows(laws.points if points is None else points)
    return results.Document(limited([Point(**row) for row in points], given.rows(laws))._asdict())


def resistance_surface(
    resistances, *, delay_second=TEMPERATURE.delay_second, c_rate=TEMPERATURE.c_rate
):
    """Resistance of one cell over SoC and temperature: three forms, and whether it separates.

    Parameters
    ----------
    resistances : rows of `resistance` with ambient_temperature_celsius and cycle, or (test,
        result) each.
    delay_second : delays into the pulse that are followed [s].
    c_rate : rate of the pulses that is preferred [1/h].

    Returns
    -------
    laws : Laws; points: measured and fitted.

    Raises
    ------
    Refusal
        Too few pulses.

    Source: docs/resistance-surface.md.
    """
    from cellwright.api import results
    from cellwright.laws import surface

    found, reasons = surface.surfaces(_rows(resistances), delay_second=delay_second, c_rate=c_rate)
    notes = (*reasons, *surface.sentences(found))
    return results.Laws(surface.law_rows(found), surface.point_rows(found), notes)


def polarisation_laws(rests):
    """Polarisation of one cell over SoC and temperature, and its laws.

    Parameters
    ----------
    rests : rows of `relaxation` with ambient_temperature_celsius, or (test, result) each.

    Returns
    -------
    laws : Laws.

    Raises
    ------
    Refusal
        No rests that compare.

    Source: thesis 3.3; docs/relaxation.md.
    """
    from cellwright.api import results
    from cellwright.laws.polarisation import comparable_rests, law_rows, laws_of, paragraph

    found = comparable_rests(_rows(rests))
    laws, reasons = laws_of(found.points)
    return results.Laws(law_rows(laws), found.points, (paragraph(found, laws), *reasons))


def ocv_over_temperature(curves=(), steps=(), settings=None, **changes):
    """Open-circuit voltage of one cell over SoC and temperature.

    Parameters
    ----------
    curves : (test, result of `ocv`) each. steps : (test, result of `chamber_steps`) each.
    settings : `settings.OcvTemperature`, or its keys as keywords.

    Returns
    -------
    map : OcvMap.

    Raises
    ------
    Refusal
        Fewer than two temperatures.

    Source: thesis 3.1; docs/ocv-temperature.md.
    """
    from cellwright.api import given, results
    from cellwright.api.models import _curves
    from cellwright.laws.ocv import over_temperature as ocv

    chosen = given.chosen(OcvTemperature, settings, changes)
    slow = given.entries(curves, _curves)
    result = ocv.over_temperature(slow, given.entries(steps), **chosen._asdict())
    return results.OcvMap(
        ocv.law_rows(result),
        ocv.map_columns(result),
        ocv.entropic_columns(result),
        ocv.surface_columns(result),
        ocv.function_rows(result),
        tuple(result.notes),
    )


def capacity_loss(capacities, settings=None, **changes):
    """Capacity of one cell lost to temperature and rate, split into true and false.

    Parameters
    ----------
    capacities : rows of `capacity` with test, ambient_temperature_celsius and cycle, or (test,
        result) each.
    settings : `settings.CapacityLoss`, or its keys as keywords.

    Returns
    -------
    losses : Laws; points: one row a loss [%].

    Raises
    ------
    Refusal
        No capacity that losses can be counted from.

    Source: thesis 4.2; docs/capacity-loss.md.
    """
    from cellwright.api import given, results
    from cellwright.laws.capacity_loss import capacity_losses, law_rows

    chosen = given.chosen(CapacityLoss, settings, changes)
    losses, notes = capacity_losses(_rows(capacities), **chosen._asdict())
    return results.Laws(law_rows(losses), losses, tuple(notes))


def ica_over_temperature(charges, settings=None, **changes):
    """Peaks of incremental capacity of one cell, matched across temperatures.

    Parameters
    ----------
    charges : `laws.peaks.Charge` each, or (test, result of `ica`).
    settings : `settings.IcaTemperature`, or its keys as keywords.

    Returns
    -------
    matches : PeakMatches.

    Raises
    ------
    Refusal
        Fewer than two temperatures.

    Source: docs/ica-temperature.md.
    """
    from cellwright.api import given, results
    from cellwright.laws.peaks import peaks_over_temperature

    chosen = given.chosen(IcaTemperature, settings, changes)
    found = peaks_over_temperature([_charge(one) for one in charges], **chosen._asdict())
    return results.PeakMatches(found.matches, found.peaks, found.curves, tuple(found.notes))


def _charge(one):
    """A charge as it is, or from (test, result of `ica`)."""
    from cellwright.api import given
    from cellwright.laws.peaks import Charge

    if isinstance(one, Charge):
        return one
    test, ica = given.test_facts(one[0]), one[1]
    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    curve = [getattr(ica.curve, name) for name in names]
    return Charge(test.test, test.ambient_temperature_celsius, ica.c_rate, *curve)


def ageing_over_temperature(cycles, test, settings=None, **changes):
    """Fade, temperature and daily cycle of the capacities of one ageing record.

    Parameters
    ----------
    cycles : result of `ageing_cycles`. test : TestFacts or mapping.
    settings : `settings.Ageing`, or its keys as keywords.

    Returns
    -------
    laws : AgeingLaws.

    Raises
    ------
    Refusal
        Too few cycles.

    Source: docs/ageing.md.
    """
    from cellwright.api import given, results
    from cellwright.laws.ageing import cycle_temperature, law_rows
    from cellwright.protocols.ageing import AgeingCycles

    table = getattr(cycles, "rows", cycles)
    if not isinstance(table, AgeingCycles):
        table = AgeingCycles(**given.columns(table, *AgeingCycles._fields))
    found = cycle_temperature(table, **given.chosen(Ageing, settings, changes)._asdict())
    rows = law_rows(found.summary, test=given.test_facts(test).test)
    notes = tuple(filter(None, [found.summary["reason"]]))
    return results.AgeingLaws(found.summary, rows, found.cycles, found.periodogram, notes)
