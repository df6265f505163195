"""Which test to run next: the menu of tests, and the one that leaves most between two explanations.

Every test begins full unless it says otherwise. Rows lie as a tester would log them: dense after
a step of the current, sparse later.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.base import STAGES
from cellwright.effects.records import stacked
from cellwright.effects.sensitivity import USUAL_NOISE, Model, at_starts_of, information, projected
from cellwright.effects.ties import tie_of
from cellwright.records.record import Record, record_of
from cellwright.refusal import Refusal

FIRST_SECOND, GROWTH = 1.0, 1.25  # rows after a step: the first gap, and how gaps grow
KELVIN = 15.0
SHARP_SECOND, SLOW_SECOND = 0.1, 30.0  # between rows, of sharp edges and of slow tests
FALL = 0.9  # of the current until a constant-voltage charge ends: from C/2 to C/20
DRIVE = (-0.4, -1.2, 0.3, 0.0, -0.8, -1.6, 0.5, -0.2, 0.0, -1.0, 0.8, -0.6)  # of 1C, 20 s each


class Rating(NamedTuple):
    """What a cell may be asked for.

    discharge_c_rate, charge_c_rate : largest loads [1/h]. least_celsius, most_celsius : [degC].
    """

    discharge_c_rate: float
    charge_c_rate: float
    least_celsius: float = -20.0
    most_celsius: float = 55.0


class Planned(NamedTuple):
    """A test of the menu.

    words : for people, within a sentence. record : without a voltage. elsewhere : at another
    temperature, where a model of one temperature knows only what depends on it.
    """

    id: str
    words: str
    record: Record
    elsewhere: bool = False

    @property
    def hours(self):
        """How long it takes [h]."""
        return float(self.record.test_time_second[-1] / 3600.0)


class Step(NamedTuple):
    """A constant current. c_rate : + on charge [1/h]. second, every : length, longest gap [s]."""

    c_rate: float
    second: float
    every: float


def rating_of(stack, capacity_ampere_hour):
    """Rating as the records show it: the largest loads that the cell was given, C/2 at least.

    Parameters
    ----------
    stack : records.Stack. capacity_ampere_hour : of the cell [Ah].

    Returns
    -------
    rating : Rating.
    """
    rates = stack.current_ampere / capacity_ampere_hour
    return Rating(max(-float(rates.min()), 0.5), max(float(rates.max()), 0.5))


def menu(cell, rating, *, celsius, drive=None):
    """All tests that may be asked for.

    Parameters
    ----------
    cell : base.Cell. rating : Rating. celsius : temperature of the records on hand [degC].
    drive : Record to be repeated at other temperatures; without one a drive is made up.

    Returns
    -------
    tests : tuple of Planned.
    """
    made = {
        "c20_both": ("a C/20 discharge and charge", _slow_cycle()),
        "rest_48h": ("a rest of 48 h at half charge", _long_rest()),
        "cccv_4": ("four cycles with constant-current constant-voltage charges", _cycles(rating)),
        "hppc": ("HPPC: pulses of several rates at ten states of charge", _hppc(rating)),
        "long_load": ("a long load of 2C with pulses in it", _long_load(rating)),
        "rest_2h": ("a long load and two hours of rest after it", _rest_after_load()),
        "edges": ("pulses with sharp edges, sampled ten times a second", _edges(rating)),
        "pulse_pairs": ("pulses of equal size in both directions", _pairs(rating)),
    }
    capacity = cell.capacity_ampere_hour
    tests = [_planned(one, words, steps, capacity, celsius) for one, (words, steps) in made.items()]
    drive = drive or _planned("drive", "", _drive(rating), capacity, celsius).record
    pulses = next(test.record for test in tests if test.id == "hppc")
    same = (("drive", "drive", drive), ("hppc", "HPPC", pulses))
    return (*tests, *(_elsewhere(*one, sign, rating, celsius) for one in same for sign in (1, -1)))


def _elsewhere(test, word, record, sign, rating, celsius):
    """The same test warmer or colder, as far as the cell may be taken."""
    at = float(np.clip(celsius + sign * KELVIN, rating.least_celsius, rating.most_celsius))
    words = f"the same {word} {abs(at - celsius):.0f} K {'warmer' if sign > 0 else 'colder'}"
    name = f"{test}_{'warm' if sign > 0 else 'cold'}"
    record = record._replace(test=name, celsius=np.full(len(record.celsius), at))
    return Planned(name, words, record, elsewhere=True)


def _planned(one, words, steps, capacity, celsius):
    gaps = [_gaps(step) for step in steps]
    second = np.concatenate([[0.0], np.cumsum(np.concatenate(gaps))])
    current = np.repeat([s.c_rate * capacity for s in steps], [len(g) for g in gaps])
    current = np.append(current, current[-1])
    blank = np.zeros(len(second))
    told = {"test": one, "kind": one, "celsius": celsius}
    return Planned(one, words, record_of(second, current, blank, 1.0, **told))


def _gaps(step):
    """Gaps between rows of a step, growing from the first to the longest [s]."""
    first = min(FIRST_SECOND, step.every)
    grown = np.log(max(step.every / first, 1.0)) / np.log(GROWTH)
    rising = first * GROWTH ** np.arange(int(grown) + 1)
    rising = rising[np.cumsum(rising) <= step.second]
    left = step.second - rising.sum()
    rows = max(round(left / step.every), 1)
    return np.concatenate([rising, np.full(rows, left / rows)]) if left > 1e-9 else rising


def _slow_cycle():
    rest = Step(0.0, 3600.0, SLOW_SECOND)
    down, up = Step(-0.05, 0.97 * 72e3, SLOW_SECOND), Step(0.05, 0.96 * 72e3, SLOW_SECOND)
    return [down, rest, up, rest]


def _long_rest():
    return [Step(-0.5, 3600.0, 10.0), Step(0.0, 48 * 3600.0, 300.0), Step(-0.5, 2880.0, 10.0)]


def _cycles(rating):
    """Discharge at up to 1C, charge at C/2, its last eighth at a falling current."""
    load = min(1.0, rating.discharge_c_rate)
    rest = Step(0.0, 1800.0, SLOW_SECOND)
    fall = np.exp(np.linspace(0.0, np.log(1.0 - FALL), 24))
    second = 0.125 * 3600.0 / (0.5 * fall.mean()) / len(fall)
    tail = [Step(0.5 * part, second, SLOW_SECOND) for part in fall]
    down, up = 0.94 * 3600.0 / load, 0.815 * 7200.0
    one = [Step(-load, down, SLOW_SECOND), rest, Step(0.5, up, SLOW_SECOND), *tail]
    return [*one, rest] * 4


def _hppc(rating):
    """Down by tenths: pulses of three rates, one back, rest; rows each second in the pulses."""
    found = [Step(0.0, 60.0, 10.0)]
    for _ in range(10):
        for share in (0.25, 0.5, 1.0):
            load = share * min(rating.discharge_c_rate, 3.0)
            found += [Step(-load, 10.0, 1.0), Step(0.0, 40.0, 5.0)]
        found += [Step(min(rating.charge_c_rate, 1.0), 10.0, 1.0), Step(0.0, 600.0, 20.0)]
        found += [Step(-0.5, 0.09 * 7200.0, 20.0), Step(0.0, 1800.0, 60.0)]
    return found


def _long_load(rating):
    load = min(2.0, rating.discharge_c_rate)
    part = Step(-load, 110.0 / load, 5.0), Step(-0.25 * load, 10.0, 1.0)
    return [*part * 26, Step(0.0, 1800.0, 20.0)]


def _rest_after_load():
    return [Step(-0.5, 3600.0, 10.0), Step(0.0, 7200.0, 30.0)]


def _edges(rating):
    load = min(3.0, rating.discharge_c_rate)
    one = Step(-load, 1.0, SHARP_SECOND), Step(0.0, 1.0, SHARP_SECOND)
    return [Step(-0.5, 3600.0, 10.0), Step(0.0, 600.0, 20.0), *one * 100]


def _pairs(rating):
    """Both directions, short and long, at four states of charge."""
    load = min(1.0, rating.discharge_c_rate, rating.charge_c_rate)
    down = [Step(-0.5, 0.2 * 7200.0, 20.0), Step(0.0, 900.0, 20.0)]
    pulses = [Step(sign * load, second, 1.0) for second in (10.0, 60.0) for sign in (-1.0, 1.0)]
    return [*down, *(step for pulse in pulses for step in (pulse, Step(0.0, 300.0, 10.0)))] * 4


def _drive(rating):
    shares = [min(max(r, -rating.discharge_c_rate), rating.charge_c_rate) for r in DRIVE]
    return [Step(rate, 20.0, 1.0) for rate in shares] * 15


RIVAL_STD = 100.0  # plausible sizes within which a rival may move to take an effect's place
TOLD = 25.0  # chi-square that a test has to add to be worth its hours
# ASSUME: a circuit errs by 3 % of its overpotential: slow tests are trusted more than fast ones.
CIRCUIT_ERROR = 0.03


class Advice(NamedTuple):
    """What to run next.

    test : id of the menu; "check" where another instrument helps and no test of the cell; None
    where nothing known does. sentence : for people. now : chi-square on the records on hand.
    table : dict of lists test, hours, chi_square, a row per test of the menu, the best first;
    chi_square : what the records on hand and this test together would leave. Tests at other
    temperatures are advised only for what depends on temperature.
    """

    test: str | None
    sentence: str
    now: float
    table: dict


class Question(NamedTuple):
    """What is asked of records: an effect at its size, and rivals in its place.

    effects : tuple of Effect: the effect unless it is in the model, the rivals, and what else
    depends on temperature.
    estimated : the effect's size is that of a fit, not a plausible one.
    """

    effect: str
    rivals: tuple
    effects: tuple
    estimated: bool


def next_test(
    case, state, effect, alternatives=(), *, library, spread=USUAL_NOISE, rating=None, drive=None
):
    """Advice on the test that tells an effect from its alternatives, or shows it at all.

    Parameters
    ----------
    case : case.Case. state : case.State, with the effect in it or not; or sensitivity.Model.
    effect : id; where the state holds it at its estimated size, else at a plausible one.
    alternatives : ids as good; without any, the effect is weighed against the model without it.
    library : dict of Effect by id. spread : noise.Noise. rating : menu.Rating; without one, as the
    records show it. drive : Record to repeat at other temperatures; without one, of the records.

    Returns
    -------
    advice : Advice.

    Raises
    ------
    Refusal : an id that the library does not hold.
    """
    unknown = [one for one in (effect, *alternatives) if one not in library]
    if unknown:
        raise Refusal(f"no effect {unknown[0]!r} to plan a test for; known: {', '.join(library)}")
    given = state if isinstance(state, Model) else Model(state.solution.values, state.effects)
    model, question = _asked(given, effect, tuple(alternatives), library)
    facts = {"tolerance": case.tolerance, "spread": spread, "circuit_error": CIRCUIT_ERROR}
    facts["asked"] = effect if question.estimated else None

    def told(stack):
        return information(case.cell, stack, at_starts_of(model, stack), question.effects, **facts)

    on_hand = information(case.cell, case.fit, model, question.effects, **facts)
    on_hand = on_hand.with_more(told(case.validation))
    now = between(on_hand, question, case.tolerance)
    tests = _tests(case, rating, drive)
    laid = {"capacity_ampere_hour": case.cell.capacity_ampere_hour, "hold": case.fit.hold}
    stacks = [stacked([test.record], **laid) for test in tests]
    left = [between(on_hand.with_more(told(s)), question, case.tolerance) for s in stacks]
    return _advice(question, library, tests, left, now)


def between(found, question, tolerance):
    """Chi-square that is left between an effect and the nearest of its rivals.

    Parameters
    ----------
    found : sensitivity.Information of all records. question : Question.
    tolerance : base.Tolerance.

    Returns
    -------
    chi_square : scalar. A rival has taken what it can, and so have the nuisances, and what
    depends on temperature within its plausible size. Without an estimate: the mean over the
    effect's starts and sizes, each at plausible size.
    """
    left = projected(found, tolerance).left
    own = [k for k, label in enumerate(found.labels) if label.effect == question.effect]
    beside = [_beside(found.labels, left, own, question, r) for r in question.rivals or (None,)]
    whole = [one.sum() if question.estimated else np.diag(one).mean() for one in beside]
    return float(max(min(whole), 0.0))


def _beside(labels, left, own, question, rival):
    """Information of the effect once one rival, and what depends on temperature, have followed."""
    others = {question.effect, *question.rivals} - {rival}
    rest = [k for k, label in enumerate(labels) if label.effect not in others]
    weight = [RIVAL_STD**-2.0 if labels[k].effect == rival else 1.0 for k in rest]
    mixed = left[np.ix_(rest, own)]
    return left[np.ix_(own, own)] - mixed.T @ np.linalg.solve(
        left[np.ix_(rest, rest)] + np.diag(weight), mixed
    )


def _asked(given, effect, rivals, library):
    """The model without the rivals, and the question."""
    pair = (effect, *rivals)
    inside = any(one.id == effect for one in given.effects)
    model = given._replace(effects=tuple(e for e in given.effects if e.id not in rivals))
    cells = [e for e in library.values() if e.stage in STAGES]
    known = {*pair, *(one.id for one in model.effects)}
    # ASSUME: at another temperature resistances, OCV and capacity may differ by plausible laws.
    warm = [e for e in cells if "temperature" in e.needs and e.id not in known]
    own = [] if inside else [library[effect]]
    effects = (*own, *(library[one] for one in rivals), *warm)
    return model, Question(effect, rivals, effects, inside)


def _tests(case, rating, drive):
    capacity = case.cell.capacity_ampere_hour
    rating = rating or rating_of(case.fit, capacity)
    drive = drive or _drive_of(case.fit) or _drive_of(case.validation)
    return menu(case.cell, rating, celsius=float(np.median(case.fit.celsius)), drive=drive)


def _drive_of(stack):
    """The longest drive of a stack as a Record, or None."""
    found = [k for k, kind in enumerate(stack.kinds) if kind == "drive"]
    if not found:
        return None
    k = max(found, key=lambda k: np.sum(stack.file == k))
    rows = stack.file == k
    columns = (stack.second, stack.current_ampere, stack.voltage_volt)
    read = (column[rows] for column in columns)
    told = {"test": stack.tests[k], "celsius": stack.celsius[rows]}
    return record_of(*read, float(stack.soc_at_start[k]), **told)


def _advice(question, library, tests, left, now):
    order = np.argsort(left, kind="stable")[::-1]
    warm = any("temperature" in library[e].needs for e in (question.effect, *question.rivals))
    first = next(k for k in order if warm or not tests[k].elsewhere)
    best, most = tests[first], left[first]
    table = {
        "test": [tests[k].id for k in order],
        "hours": [tests[k].hours for k in order],
        "chi_square": [left[k] for k in order],
    }
    ties = [tie_of(question.effect, rival) for rival in question.rivals or (None,)]
    ties = [tie for tie in ties if tie is not None]
    helps = most - now >= TOLD and not any(tie.exact for tie in ties)
    test = best.id if helps else "check" if ties else None
    effect = library[question.effect]
    return Advice(test, _sentence(effect, question, ties, best, most, now, helps), now, table)


def _sentence(effect, question, ties, best, most, now, helps):
    goal, of = _goal(question, ties), "between them" if question.rivals else "of it"
    ways = [tie.check for tie in dict.fromkeys(ties)]
    if helps:
        gain = f"which would leave chi-square {most:.0f} {of}; now {now:.0f}"
        ways.append(f"{best.words} (about {_long(best.hours)}), {gain}")
    elif not ways:
        ways = [f"{effect.shows}; no test of the menu leaves more than chi-square {most:.0f} {of}"]
    return f"{goal}: {'; or '.join(ways)}."


def _goal(question, ties):
    if question.rivals:
        return f"To tell {_named(question.effect)} from {' or '.join(map(_named, question.rivals))}"
    apart = f" apart from {_named(ties[0].partner)}" if ties else ""
    return f"To see {_named(question.effect)}{apart}"


def _named(effect):
    return effect.replace("_", " ")


def _long(hours):
    return f"{hours:.0f} h" if hours >= 1.5 else f"{60 * hours:.0f} min"
