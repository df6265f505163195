"""Which test to run next: the one that leaves most between two explanations, from sensitivities."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.effect import STAGES
from cellwright.effects.menu import menu, rating_of
from cellwright.effects.records import Record, stacked
from cellwright.effects.sensitivity import (
    USUAL_NOISE,
    Model,
    at_starts_of,
    information,
    projected,
)
from cellwright.effects.structural import tie_of
from cellwright.refusal import Refusal

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
    tolerance : plain.Tolerance.

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
    columns = (stack.second, stack.current_ampere, stack.voltage_volt, stack.celsius)
    told = (column[rows] for column in columns)
    return Record(stack.tests[k], "drive", *told, float(stack.soc_at_start[k]))


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
