"""Which test to run next: the menu of tests, and the one that separates two explanations best.

Every test begins full unless it says otherwise. Rows lie as a tester would log them: dense after
a step of the current, sparse later.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.base import STAGES
from cellwright.effects.planning.sensitivity import Model, at_starts_of, information, projected
from cellwright.effects.records import stacked
from cellwright.effects.ties import needs_another_temperature, tie_between
from cellwright.numerics.noise import FIRST
from cellwright.records.record import Record, record_of
from cellwright.refusal import Refusal

FIRST_SECOND, GROWTH = 1.0, 1.25  # rows after a step: the first gap, and how gaps grow
KELVIN = 15.0
SHARP_SECOND, SLOW_SECOND = 0.1, 30.0  # between rows, of sharp edges and of slow tests
FALL = 0.9  # of the current until a constant-voltage charge ends: from C/2 to C/20
DRIVE = (-0.4, -1.2, 0.3, 0.0, -0.8, -1.6, 0.5, -0.2, 0.0, -1.0, 0.8, -0.6)  # of 1C, 20 s each
RIVAL_STD = 100.0  # plausible sizes within which a rival may move to take an effect's place
WORTH_IT = 25.0  # chi-square that a test has to add to be worth its hours
# ASSUME: a circuit errs by 3 % of its overpotential: slow tests are trusted more than fast ones.
CIRCUIT_ERROR = 0.03


class Rating(NamedTuple):
    """Limits of a cell that a planned test keeps.

    discharge_c_rate, charge_c_rate : largest loads [1/h]. least_celsius, most_celsius : [degC].
    """

    discharge_c_rate: float
    charge_c_rate: float
    least_celsius: float = -20.0
    most_celsius: float = 55.0


class Planned(NamedTuple):
    """A test of the menu.

    words : for people, within a sentence. record : without a voltage. elsewhere : at another
    temperature than the records on hand.
    """

    id: str
    words: str
    record: Record
    elsewhere: bool = False

    @property
    def hours(self):
        """Duration [h]."""
        return float(self.record.test_time_second[-1] / 3600.0)


class Step(NamedTuple):
    """A constant current. c_rate : + on charge [1/h]. second, every : length, longest gap [s]."""

    c_rate: float
    second: float
    every: float


def rating_of(stack, capacity_ampere_hour):
    """Rating by the largest loads in the records, C/2 at least.

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
    """All tests that may be advised.

    Parameters
    ----------
    cell : base.Cell. rating : Rating. celsius : temperature of the records on hand [degC].
    drive : Record to be repeated at other temperatures; without one a drive of set loads.

    Returns
    -------
    tests : tuple of Planned.
    """
    steps_of = {
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
    tests = [_planned(i, words, steps, capacity, celsius) for i, (words, steps) in steps_of.items()]
    drive = drive or _planned("drive", "", _drive(rating), capacity, celsius).record
    pulses = next(test.record for test in tests if test.id == "hppc")
    same = (("drive", "drive", drive), ("hppc", "HPPC", pulses))
    return (
        *tests,
        *(_elsewhere(*test, sign, rating, celsius) for test in same for sign in (1, -1)),
    )


def _elsewhere(test, word, record, sign, rating, celsius):
    """The same test warmer or colder by 15 K, within the rating."""
    at = float(np.clip(celsius + sign * KELVIN, rating.least_celsius, rating.most_celsius))
    words = f"the same {word} {abs(at - celsius):.0f} K {'warmer' if sign > 0 else 'colder'}"
    name = f"{test}_{'warm' if sign > 0 else 'cold'}"
    record = record._replace(test=name, celsius=np.full(len(record.celsius), at))
    return Planned(name, words, record, elsewhere=True)


def _planned(test, words, steps, capacity, celsius):
    """A test of the menu from its steps of constant current."""
    gaps = [_gaps(step) for step in steps]
    second = np.concatenate([[0.0], np.cumsum(np.concatenate(gaps))])
    current = np.repeat([s.c_rate * capacity for s in steps], [len(g) for g in gaps])
    current = np.append(current, current[-1])
    blank = np.zeros(len(second))
    record = record_of(second, current, blank, 1.0, test=test, kind=test, celsius=celsius)
    return Planned(test, words, record)


def _gaps(step):
    """Gaps between rows of a step, growing from the first to the longest [s]."""
    first = min(FIRST_SECOND, step.every)
    grown = np.log(max(step.every / first, 1.0)) / np.log(GROWTH)
    rising = first * GROWTH ** np.arange(int(grown) + 1)
    rising = rising[np.cumsum(rising) <= step.second]
    even_second = step.second - rising.sum()
    if even_second <= 1e-9:
        return rising
    rows = max(round(even_second / step.every), 1)
    return np.concatenate([rising, np.full(rows, even_second / rows)])


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
    cycle = [Step(-load, down, SLOW_SECOND), rest, Step(0.5, up, SLOW_SECOND), *tail]
    return [*cycle, rest] * 4


def _hppc(rating):
    """Discharge by tenths; at each three pulses, one charge pulse and a rest, rows each second."""
    steps = [Step(0.0, 60.0, 10.0)]
    for _ in range(10):
        for share in (0.25, 0.5, 1.0):
            load = share * min(rating.discharge_c_rate, 3.0)
            steps += [Step(-load, 10.0, 1.0), Step(0.0, 40.0, 5.0)]
        steps += [Step(min(rating.charge_c_rate, 1.0), 10.0, 1.0), Step(0.0, 600.0, 20.0)]
        steps += [Step(-0.5, 0.09 * 7200.0, 20.0), Step(0.0, 1800.0, 60.0)]
    return steps


def _long_load(rating):
    load = min(2.0, rating.discharge_c_rate)
    part = Step(-load, 110.0 / load, 5.0), Step(-0.25 * load, 10.0, 1.0)
    return [*part * 26, Step(0.0, 1800.0, 20.0)]


def _rest_after_load():
    return [Step(-0.5, 3600.0, 10.0), Step(0.0, 7200.0, 30.0)]


def _edges(rating):
    load = min(3.0, rating.discharge_c_rate)
    pulse = Step(-load, 1.0, SHARP_SECOND), Step(0.0, 1.0, SHARP_SECOND)
    return [Step(-0.5, 3600.0, 10.0), Step(0.0, 600.0, 20.0), *pulse * 100]


def _pairs(rating):
    """Pulses in both directions, short and long, at four states of charge."""
    load = min(1.0, rating.discharge_c_rate, rating.charge_c_rate)
    down = [Step(-0.5, 0.2 * 7200.0, 20.0), Step(0.0, 900.0, 20.0)]
    pulses = [Step(sign * load, second, 1.0) for second in (10.0, 60.0) for sign in (-1.0, 1.0)]
    return [*down, *(step for pulse in pulses for step in (pulse, Step(0.0, 300.0, 10.0)))] * 4


def _drive(rating):
    shares = [min(max(r, -rating.discharge_c_rate), rating.charge_c_rate) for r in DRIVE]
    return [Step(rate, 20.0, 1.0) for rate in shares] * 15


class Advice(NamedTuple):
    """What to run next.

    test : id of the menu; "check" where only another instrument helps; None where nothing in the
    menu helps. sentence : for people. now : chi-square on the records on hand.
    table : dict of lists test, hours, chi_square, a row per test of the menu, the best first;
    chi_square : see `between`, of the records on hand and this test together. Tests at other
    temperatures are advised only for what depends on temperature.
    """

    test: str | None
    sentence: str
    now: float
    table: dict


class Question(NamedTuple):
    """What a test is to answer: an effect at its size, or one of its rivals instead.

    effects : tuple of Effect: the effect unless it is in the model, the rivals, and the other
    effects of temperature.
    estimated : the effect's size is that of a fit, not a plausible one. proof : see `next_test`.
    """

    effect: str
    rivals: tuple
    effects: tuple
    estimated: bool
    proof: bool = False


def next_test(
    case,
    state,
    effect,
    alternatives=(),
    *,
    library,
    spread=FIRST,
    rating=None,
    drive=None,
    proof=False,
):
    """Advice on the test that tells an effect from its alternatives, or shows it without any.

    Parameters
    ----------
    case : case.Case. state : state.State, with the effect in it or not; or sensitivity.Model.
    effect : id; where the state holds it at its estimated size, else at a plausible one.
    alternatives : ids as good; without any, the effect is weighed against the model without it.
    library : dict of Effect by id. spread : noise.Noise. rating : Rating; without one, as the
    records show it. drive : Record to repeat at other temperatures; without one, of the records.
    proof : the test is to judge an effect that the records fitted show already: what they show of
    it does not count.

    Returns
    -------
    advice : Advice.

    Raises
    ------
    Refusal : an id that the library does not hold.
    """
    unknown = [name for name in (effect, *alternatives) if name not in library]
    if unknown:
        raise Refusal(f"no effect {unknown[0]!r} to plan a test for; known: {', '.join(library)}")
    model = state if isinstance(state, Model) else Model(state.solution.values, state.effects)
    model, question = _question(model, effect, tuple(alternatives), library, proof)
    facts = {"tolerance": case.tolerance, "spread": spread, "circuit_error": CIRCUIT_ERROR}
    facts["asked"] = effect if question.estimated else None

    def informed_by(stack):
        return information(case.cell, stack, at_starts_of(model, stack), question.effects, **facts)

    fitted = information(case.cell, case.fit, model, question.effects, **facts)
    on_hand = fitted.with_more(informed_by(case.validation))
    known = between(fitted, question, case.tolerance) if proof else 0.0
    now = max(between(on_hand, question, case.tolerance) - known, 0.0)
    tests = _tests(case, rating, drive)
    if needs_another_temperature(effect, *alternatives):
        # However well its shape tells them apart, a test at this one leaves them a tie.
        tests = tuple(test for test in tests if test.elsewhere)
    layout = {"capacity_ampere_hour": case.cell.capacity_ampere_hour, "hold": case.fit.hold}
    stacks = [stacked([test.record], **layout) for test in tests]
    sums = (on_hand.with_more(informed_by(stack)) for stack in stacks)
    chi_square = [max(between(total, question, case.tolerance) - known, 0.0) for total in sums]
    return _advice(question, library, tests, chi_square, now)


def between(information, question, tolerance):
    """Chi-square between an effect and the nearest of its rivals [1].

    Parameters
    ----------
    information : sensitivity.Information of all records. question : Question.
    tolerance : base.Tolerance.

    Returns
    -------
    chi_square : scalar, of the effect once a rival, the nuisances, and the effects of temperature
    within their plausible size have taken what they can. Without an estimate: the mean over the
    effect's starts and sizes, each at plausible size.
    """
    chi_square = projected(information, tolerance)
    asked = [k for k, label in enumerate(information.labels) if label.effect == question.effect]
    remaining = [
        _without_rival(information.labels, chi_square, asked, question, rival)
        for rival in question.rivals or (None,)
    ]
    totals = [m.sum() if question.estimated else np.diag(m).mean() for m in remaining]
    return float(max(min(totals), 0.0))


def _without_rival(labels, chi_square, asked, question, rival):
    """Information of the effect with one rival and the effects of temperature projected out."""
    others = {question.effect, *question.rivals} - {rival}
    rest = [k for k, label in enumerate(labels) if label.effect not in others]
    weight = [RIVAL_STD**-2.0 if labels[k].effect == rival else 1.0 for k in rest]
    mixed = chi_square[np.ix_(rest, asked)]
    return chi_square[np.ix_(asked, asked)] - mixed.T @ np.linalg.solve(
        chi_square[np.ix_(rest, rest)] + np.diag(weight), mixed
    )


def _question(model, effect, rivals, library, proof):
    """The model without the rivals, and the Question."""
    inside = any(e.id == effect for e in model.effects)
    model = model._replace(effects=tuple(e for e in model.effects if e.id not in rivals))
    named = {effect, *rivals, *(e.id for e in model.effects)}
    # ASSUME: at another temperature resistances, OCV and capacity may differ by plausible laws.
    warm = [
        e
        for e in library.values()
        if e.stage in STAGES and "temperature" in e.needs and e.id not in named
    ]
    asked = [] if inside else [library[effect]]
    effects = (*asked, *(library[rival] for rival in rivals), *warm)
    return model, Question(effect, rivals, effects, inside, proof)


def planned(case, test):
    """A test of a case's menu.

    Parameters
    ----------
    case : case.Case. test : id.

    Returns
    -------
    planned : Planned.

    Raises
    ------
    Refusal : the menu has no such test.
    """
    tests = {one.id: one for one in _tests(case, None, None)}
    if test not in tests:
        raise Refusal(f"no test {test!r} in the menu; there are: {', '.join(tests)}")
    return tests[test]


def _tests(case, rating, drive):
    capacity = case.cell.capacity_ampere_hour
    rating = rating or rating_of(case.fit, capacity)
    drive = drive or _drive_of(case.fit) or _drive_of(case.validation)
    return menu(case.cell, rating, celsius=float(np.median(case.fit.celsius)), drive=drive)


def _drive_of(stack):
    """The longest drive of a stack as a Record, or None."""
    drives = [k for k, kind in enumerate(stack.kinds) if kind == "drive"]
    if not drives:
        return None
    k = max(drives, key=lambda k: np.sum(stack.file == k))
    rows = stack.file == k
    columns = (stack.second, stack.current_ampere, stack.voltage_volt)
    return record_of(
        *(column[rows] for column in columns),
        float(stack.soc_at_start[k]),
        test=stack.tests[k],
        celsius=stack.celsius[rows],
    )


def _advice(question, library, tests, chi_square, now):
    order = np.argsort(chi_square, kind="stable")[::-1]
    warm = any("temperature" in library[e].needs for e in (question.effect, *question.rivals))
    first = next(k for k in order if warm or not tests[k].elsewhere)
    best, most = tests[first], chi_square[first]
    table = {
        "test": [tests[k].id for k in order],
        "hours": [tests[k].hours for k in order],
        "chi_square": [chi_square[k] for k in order],
    }
    ties = _ties(library[question.effect], question.rivals)
    helps = most - now >= WORTH_IT and not any(tie.exact for tie in ties)
    test = best.id if helps else "check" if ties else None
    effect = library[question.effect]
    return Advice(test, _sentence(effect, question, ties, best, most, now, helps), now, table)


def _ties(effect, rivals):
    """Structural ties of an effect with its rivals; without any, those that make it invisible."""
    if not rivals:
        return [tie for tie in effect.ties if tie.always and tie.exact]
    ties = (tie_between(effect.id, rival) for rival in rivals)
    return [tie for tie in ties if tie is not None]


def _sentence(effect, question, ties, best, most, now, helps):
    goal = _goal(question, ties)
    shows = "tell them apart" if question.rivals else "show it"
    ways = [tie.check for tie in dict.fromkeys(ties)]
    if helps:
        gain = f"which would {shows} by {_deviations(most)}; now {_deviations(now)}"
        hours = best.hours
        lasting = f"{hours:.0f} h" if hours >= 1.5 else f"{60 * hours:.0f} min"
        ways.append(f"{best.words} (about {lasting}), {gain}")
    elif not ways:
        least = f"no test of the menu would {shows} by more than {_deviations(most)}"
        ways = [f"{effect.shows}; {least}"]
    return f"{goal}: {'; or '.join(ways)}."


def _deviations(chi_square):
    """A chi-square as people weigh it: as many standard deviations as its root."""
    return f"{np.sqrt(max(chi_square, 0.0)):.0f} standard deviations"


def _goal(question, ties):
    if question.rivals:
        return f"To tell {_named(question.effect)} from {' or '.join(map(_named, question.rivals))}"
    if question.proof:
        return f"To prove {_named(question.effect)} on a record that is not fitted"
    apart = f" apart from {_named(ties[0].partner)}" if ties else ""
    return f"To see {_named(question.effect)}{apart}"


def _named(effect):
    return effect.replace("_", " ")
