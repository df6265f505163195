"""Health over a life: fade, knee and remaining cycles; check-ups; fleets and protocols compared."""

from cellwright.api import inputs, results
from cellwright.settings import Health


def fade(records, cell, settings=None, **changes):
    """Fade of a cell over its ageing records: law, knee, and cycles that remain.

    Parameters
    ----------
    records : list of (test, cycles, temperature): TestFacts or mapping; result of `ageing_cycles`
        or its columns; result of `ageing_over_temperature`, a pair (summary, columns of its
        cycles), or None.
    cell : CellFacts or mapping. settings : `settings.Health`, or its keys as keywords.

    Returns
    -------
    fade : Result; columns: one row a discharge [Ah], [Wh], [1]; laws: one row a law;
        summary: knee, remaining cycles and state of health at the last cycle.

    Raises
    ------
    Refusal : Too few comparable discharges, or records that do not follow each other.

    Source: docs/health-fade.md.
    """
    from cellwright.health import lives
    from cellwright.health.of_life import analysed

    options = inputs.settings_of(Health, settings, changes)
    ready = []
    for test, cycles, temperature in records:
        facts = inputs.test_facts(test)
        columns = inputs.columns(getattr(cycles, "rows", cycles))
        shift = _shift(temperature)
        about = facts.test, facts.cycle, facts.ambient_temperature_celsius
        ready.append(lives.AgeingRecord(*about, columns, shift))
    rated = inputs.cell_facts(cell).rated_capacity_ampere_hour
    life = lives.life_of(ready, rated_capacity_ampere_hour=rated)
    columns, laws, summary = analysed(life, **options._asdict())
    return results.Result({"columns": columns, "laws": laws}, {"summary": summary}, life.notes)


def _shift(temperature):
    """What temperature added to each discharge, of a result, a pair or None."""
    from cellwright.health.lives import temperature_shift

    if temperature is None:
        return {}
    pair = temperature
    if hasattr(temperature, "summary"):
        pair = temperature.summary, temperature.cycles
    return temperature_shift(*pair)


def check_ups(capacities, resistances, cell, throughputs=()):
    """Ratings of every check-up of a cell, and resistance over SoC with its growth.

    Parameters
    ----------
    capacities, resistances : rows of `capacity` and `resistance` with ambient_temperature_celsius
        and cycle: (test, result) each, or tables of them.
    cell : CellFacts or mapping. throughputs : pairs (cycle, [Ah]) of its ageing records.

    Returns
    -------
    check_ups : Result; rows: one a check-up; growth: one a pulse.

    Raises
    ------
    Refusal : No capacity and no resistance.

    Source: docs/health-check-ups.md.
    """
    from cellwright.health import ratings
    from cellwright.refusal import Refusal

    facts = inputs.cell_facts(cell)
    sizes, pulses = inputs.entries(capacities), inputs.entries(resistances)
    limits = facts._asdict()
    limits.pop("cell")
    rows, notes = ratings.check_ups(sizes, pulses, throughputs=throughputs, **limits)
    try:
        growth = ratings.resistance_growth(pulses, sizes)
    except Refusal as refusal:
        growth, notes = [], [*notes, str(refusal)]
    return results.Result({"rows": rows, "growth": growth}, notes=tuple(notes))


def state_of_health(check_ups=(), fade=None, modes=(), peaks=()):
    """State of health of a cell by each method, at each check-up or cycle.

    Parameters
    ----------
    check_ups : result of `check_ups` or its rows. fade : result of `fade`, or a pair (summary,
        columns), or None. modes, peaks : rows of degradation modes, of capacities from peaks.

    Returns
    -------
    health : Result; rows: one a method and check-up or cycle.

    Raises
    ------
    Refusal : No method tells anything.

    Source: docs/health-check-ups.md.
    """
    from cellwright.health.table import health_rows
    from cellwright.refusal import Refusal

    life, course = (
        (fade.summary, fade.columns) if hasattr(fade, "summary") else fade or (None, None)
    )
    rows = health_rows(
        check_ups=inputs.rows(check_ups), life=life, course=course, modes=modes, peaks=peaks
    )
    if not rows:
        raise Refusal("no capacity of a check-up and no life: no state of health")
    return results.Result({"rows": rows})


def fleet_resistance(cells):
    """Capacity of each cell of a fleet from its resistances over SoC, as the other cells tell it.

    Parameters
    ----------
    cells : (name, first row of `check_ups`, its rows of growth) each, of one type and temperature.

    Returns
    -------
    fleet : Result; line: of resistance over capacity, a dict; rows: one a cell.

    Raises
    ------
    Refusal : Fewer than six cells, or all alike.

    Source: thesis 4.4; docs/health-fleet.md.
    """
    from cellwright.health.fleet import capacity_from_resistance, over_shared_soc

    ready = [(name, inputs.rows([row])[0], inputs.rows(growth)) for name, row, growth in cells]
    fleet = over_shared_soc(ready)
    line, rows = capacity_from_resistance(fleet)
    return results.Result({"rows": rows}, {"line": line, "delay": fleet.delay})


def compare_protocols(lives):
    """Ageing protocols of one type of cells compared pair by pair, beyond what cells differ by.

    Parameters
    ----------
    lives : (cell, protocol, result of `fade` or a pair (summary, columns)) each.

    Returns
    -------
    comparisons : Result; rows: one a pair of protocols.

    Raises
    ------
    Refusal : Fewer than two protocols, or a life that has hardly faded.

    Source: docs/health-fleet.md.
    """
    import numpy as np

    from cellwright.health.protocols_compared import LifeOfProtocol, compared

    ready = []
    for cell, protocol, fade in lives:
        summary, columns = (fade.summary, fade.columns) if hasattr(fade, "summary") else fade
        law = np.asarray(columns["law_ampere_hour"], float)
        share = law / summary["start_ampere_hour"]
        ready.append(LifeOfProtocol(cell, protocol, np.asarray(columns["cycle"], float), share))
    return results.Result({"rows": compared(ready)})
