"""Health over a life: fade, check-ups, peaks of dQ/dV; fleets and protocols compared."""

from cellwright.api import inputs, results
from cellwright.settings import Health, Instrument


def fade(records, cell, settings=None, *, check_ups=(), **changes):
    """Fade of a cell over its ageing records, or its check-ups: law, knee, and cycles that remain.

    records : list of (test, result of `ageing_cycles`, temperature): the last the result of
        `ageing_over_temperature`, a pair (summary, columns of its cycles), or None.
    settings : `settings.Health`.
    check_ups : result of `check_ups` or its rows: of a cell without ageing records (`records`
        empty) they are the life.

    Returns columns: one row a discharge [Ah], [Wh], [1]; laws: one row a law; summary: knee,
    remaining cycles and state of health at the last cycle. Raises Refusal: too few comparable
    discharges, or records that do not follow each other. Source: docs/health.md.
    """
    from cellwright.health import lives
    from cellwright.health.of_life import analysed

    options = inputs.settings_of(Health, settings, changes)
    ready = []
    for test, cycles, temperature in records:
        facts = inputs.test_facts(test)
        columns = inputs.columns(getattr(cycles, "rows", cycles), *lives.COLUMNS)
        pair = _pair(temperature, "cycles")
        # A room that warms by a few kelvin over a year looks like a cell that ages more slowly.
        shift = {} if pair is None else lives.temperature_shift(*pair)
        about = facts.test, facts.cycle, facts.ambient_temperature_celsius
        ready.append(lives.AgeingRecord(*about, columns, shift))
    if ready:
        rated = inputs.cell_facts(cell).rated_capacity_ampere_hour
        life = lives.life_of(ready, rated_capacity_ampere_hour=rated)
    else:
        life = lives.life_of_check_ups(inputs.entries(getattr(check_ups, "rows", check_ups)))
    columns, laws, summary = analysed(life, **options._asdict())
    return results.Result({"columns": columns, "laws": laws}, {"summary": summary}, life.notes)


def _pair(found, table="columns"):
    """(summary, columns) of a result; a pair or None as it is."""
    return (found.summary, getattr(found, table)) if hasattr(found, "summary") else found


def check_ups(capacities, resistances, cell, throughputs=()):
    """Ratings of every check-up of a cell, and resistance over SoC with its growth.

    throughputs : pairs (cycle, discharged up to there [Ah]) of its ageing records.

    Returns rows, one a check-up; growth: one a pulse. Raises Refusal: no capacity and no
    resistance. Source: docs/health.md.
    """
    from cellwright.health import ratings
    from cellwright.refusal import Refusal

    health = inputs.cell_facts(cell).state_of_health
    sizes, pulses = inputs.entries(capacities), inputs.entries(resistances)
    known = inputs.ratings(cell) | {"state_of_health": health}
    rows, notes = ratings.check_ups(sizes, pulses, throughputs=throughputs, **known)
    # Ratings stand without pulses as well: a refusal of these is a note.
    try:
        growth = ratings.resistance_growth(pulses, sizes)
    except Refusal as refusal:
        growth, notes = [], [*notes, str(refusal)]
    return results.Result({"rows": rows, "growth": growth}, notes=tuple(notes))


def capacity_between_rests(tests, basis, settings=None, **changes):
    """Capacity [Ah] of a cell from parts of its charge: between two rests, by the OCV of its basis.

    tests : (test, series, result of `segment`) each; one that the curve itself is from is left out.
    basis : result of `basis`, or its document. settings : `settings.Instrument`.

    Returns rows, one a test: capacity and its standard deviation [Ah], the charge between the rests
    [Ah], SoC of both with their deviations [1], doubt; empty columns where no test tells a capacity
    so. What tells nothing is in the notes, with the reason. Source: docs/capacity.md.
    """
    from cellwright.health.between_rests import NO_ROWS, capacity_of_test, sentences_of
    from cellwright.refusal import Refusal

    options = inputs.settings_of(Instrument, settings, changes)
    known, rows, reasons = inputs.basis(basis), [], {}
    for test, series, steps in tests:
        facts = inputs.test_facts(test)
        columns = inputs.columns(series, *inputs.COUNTED)
        try:
            rows.append(
                capacity_of_test(columns, inputs.steps(steps), facts, known, **options._asdict())
            )
        except Refusal as refusal:
            reasons.setdefault(str(refusal), []).append(facts.test)
    notes = sentences_of(reasons)
    return results.Result({"rows": rows or NO_ROWS}, notes=notes)


def state_of_health(check_ups=(), fade=None, modes=(), peaks=()):
    """State of health of a cell by each method, at each check-up or cycle.

    check_ups : result of `check_ups` or its rows.
    fade : result of `fade`, or a pair (summary, columns), or None.
    modes, peaks : rows of degradation modes, of capacities from peaks.

    Returns rows, one a method and check-up or cycle. Raises Refusal: no method tells anything.
    Source: docs/health.md.
    """
    from cellwright.health.table import health_rows
    from cellwright.refusal import Refusal

    life, course = _pair(fade) or (None, None)
    rows = inputs.rows(check_ups)
    rows = health_rows(check_ups=rows, life=life, course=course, modes=modes, peaks=peaks)
    if not rows:
        raise Refusal("no capacity of a check-up and no life: no state of health")
    return results.Result({"rows": rows})


def ica_tracks(charges, *, chemistry=""):
    """Peaks of dQ/dV of one cell under names that stay through its life.

    charges : `health.peaks.tracking.TrackedCharge` each.
    chemistry : of the cell, for names alone.

    Returns rows, one a peak and charge. Raises Refusal: fewer
    than two charges, or no peak in any. Source: docs/ica.md.
    """
    from cellwright.health.peaks.tracking import tracked_peaks

    return results.Result({"rows": tracked_peaks(charges, chemistry=chemistry or "")})


def health_from_peaks(peaks, capacities, curves=None, *, rated_ampere_hour=None, tracked=()):
    """State of health of cells of one type from peaks of dQ/dV, calibrated on known capacities.

    peaks : rows of `ica_peaks` with cell, test, cycle and ambient_temperature_celsius, or of
        `ica_tracks` with cell.
    capacities : rows of `capacity` with cell, cycle and ambient_temperature_celsius; of
        `ageing_cycles` also test, and of_a_life, true.
    curves : mapping of the curve of `ica` (or its columns) by (cell, test, cycle); None: the
        charge between two peaks is not used.
    rated_ampere_hour : rating of the type [Ah], None: not known.
    tracked : cells in which an identity is one peak through the life.

    Returns one row a charge. Raises Refusal: fewer than four charges of known capacity at any rate
    and temperature. Source: docs/health.md.
    """
    from cellwright.health.peaks.calibration import peak_calibration, peak_charges

    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    pairs = {key: inputs.quantities(curve, names) for key, curve in (curves or {}).items()}
    charges = peak_charges(inputs.rows(peaks), inputs.rows(capacities), pairs)
    rows, information, notes = peak_calibration(
        charges, rated_ampere_hour=rated_ampere_hour, tracked=tracked
    )
    return results.Result({"rows": rows, "information": information}, notes=tuple(notes))


def fleet_resistance(cells):
    """Capacity of each cell of a fleet from its resistances over SoC, as the other cells tell it.

    cells : (name, first row of `check_ups`, its rows of growth) each, of one type and temperature.

    Returns rows, one a cell; line: of resistance over capacity, a dict. Raises Refusal: fewer than
    six cells, or all alike. Source: thesis 4.4; docs/health.md.
    """
    from cellwright.health.fleet import capacity_from_resistance, over_shared_soc

    # Means over the SoC that all cells were pulsed at: resistance rises steeply when empty.
    ready = [(name, inputs.rows([row])[0], inputs.rows(growth)) for name, row, growth in cells]
    fleet = over_shared_soc(ready)
    line, rows = capacity_from_resistance(fleet)
    return results.Result({"rows": rows}, {"line": line, "delay": fleet.delay})


def compare_protocols(lives):
    """Ageing protocols of one type of cells compared pair by pair, beyond what cells differ by.

    lives : (cell, protocol, result of `fade` or a pair (summary, columns)) each.

    Returns rows, one a pair of protocols. Raises Refusal: fewer than two protocols,
    or a life that has hardly faded. Source: docs/health.md.
    """
    import numpy as np

    from cellwright.health.protocols_compared import LifeOfProtocol, compared

    ready = []
    for cell, protocol, fade in lives:
        summary, columns = _pair(fade)
        # Laws instead of points: a scattered discharge must not decide how long a protocol lasts.
        share = np.asarray(columns["law_ampere_hour"], float) / summary["start_ampere_hour"]
        ready.append(LifeOfProtocol(cell, protocol, np.asarray(columns["cycle"], float), share))
    return results.Result({"rows": compared(ready)})
