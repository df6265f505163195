"""From the rounds of a search to a verdict."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.effects.candidates import judged, neutral, trial_of
from cellwright.effects.ceiling import reached
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.odds import likely, probabilities, sharpened, sure_beside, without_name
from cellwright.effects.proof import left_volt, significant
from cellwright.effects.search import beside_names, search, up_to
from cellwright.effects.stated.readings import corrected, misread
from cellwright.numerics.least_squares import fit, stds

READ_ANEW = 2  # times at most that an error of reading is taken off and the search repeated
IMPOSSIBLE = "refitted with all others its size is at the limit of what it can be"
OUTDONE = "more is explained if, in its place, {}"
REFUSED = (
    "refitted with all others it makes the error on the records that judge larger",
    "other choices of the blocks name it in less than half of the cases",
    "it explains less than a function of SoC, temperature and past current without physics",
)


class Outcome(NamedTuple):
    """Result of a search in one word, and the errors behind it.

    word : "none", "named", "ambiguous" or "unknown". steps : rounds whose choice is in the model
    at the end. last : State at the end. floor : proof.Floor. closed : share of the gap that is
    closed on the validation records, by all effects. excess_volt : error left beyond the floor, of
    the side, fit or proof, where it is larger. adequate : nobody would act on that.
    refused : round whose choice is no name in the end. why_refused : why, in words.
    """

    word: str
    steps: tuple
    last: object
    floor: object
    closed: float | None
    excess_volt: float
    adequate: bool
    refused: object = None
    why_refused: str = ""


def outcome(rounds, gates, *, alternatives=lambda step: step.tied):
    """Outcome of the rounds of a search: its word, and what is left of the gap.

    Parameters
    ----------
    rounds : list of search.Round. gates : case.Gates or groups.known.GroupGates.
    alternatives : function (round) → ids of effects that its data cannot tell from the choice.

    Returns
    -------
    outcome : Outcome.
    """
    first, last, floor = rounds[0].before, rounds[-1].before, rounds[0].floor
    kept = {effect.key for effect in last.effects}
    chose = (step for step in rounds if step.chosen is not None)
    steps = tuple(step for step in chose if step.chosen.effect.key in kept)
    excess = left_volt(last, floor)
    adequate = excess <= gates.unknown_volt
    if not steps:
        return Outcome("none" if adequate else "unknown", (), first, floor, None, excess, adequate)
    errors = first.validation_rmse_volt, last.validation_rmse_volt
    closed = gap_closed(*errors, floor.validation_volt)
    word = "ambiguous" if any(alternatives(step) for step in steps) else "named"
    return Outcome(word, steps, last, floor, closed, excess, adequate)


def decided(case, rounds):
    """What the rounds of a search come to: names that stand for themselves, and are likely.

    Parameters
    ----------
    case : case.Case. rounds : list of search.Round.

    Returns
    -------
    rounds : list of search.Round, up to the first name that falls short of what could be learned
    without physics (`ceiling.reached`), is less likely than not (`odds.likely`), or makes the model
    worse on records that judge. Beside the likeliest name those that are not sure have none
    (`odds.sure_beside`), and stay in the model.
    result : verdict.Outcome. shares : probability of each answer as told, names that are refused
    among them.
    """
    rounds, short = reached(case, rounds, rounds[0].floor)
    result = outcome(rounds, case.gates)
    shares = probabilities(case, rounds, result)
    rounds, unlikely = likely(rounds, result, shares)
    rounds = sure_beside(rounds, outcome(rounds, case.gates), sharpened(shares))
    rounds, worse = _helping(rounds, outcome(rounds, case.gates))
    result = outcome(rounds, case.gates)
    ways = zip((worse, unlikely, short), REFUSED, strict=True)
    refused, why = next(((step, why) for step, why in ways if step is not None), (None, ""))
    return rounds, result._replace(refused=refused, why_refused=why), sharpened(shares)


class Searched(NamedTuple):
    """What a search comes to: the case it ended with; rounds, result, shares as of `decided`.

    holds : Solutions of the last model under the hold of the case and under the other one, by the
    same noise; () where that was not asked. alone : Solution of the model of the names without what
    joined them at the end, see `beside_names`; None where nothing did. outside : Trials, beside the
    last model, of what the vocabulary has no name for and what is left shows.
    """

    case: object
    rounds: list
    result: object
    shares: dict
    holds: tuple = ()
    alone: object = None
    outside: tuple = ()


def searched(case, library):
    """What a search comes to; where one test alone is read wrongly, once that is taken off.

    Parameters
    ----------
    case : case.Case. library : dict of Effect by id.

    Returns
    -------
    found : Searched.
    """
    found = _under_a_hold(case, library)
    for _ in range(READ_ANEW):
        about = found.case, found.result.last, found.rounds[-1].filters, found.result.floor
        wrong = misread(*about, _fit_of)
        if wrong is None:
            break
        found = _under_a_hold(corrected(found.case, wrong), library)
    return found


def _under_a_hold(case, library):
    """What a search comes to, under the hold of the current by which it follows the records best.

    The hold is chosen by the model without effects. Where the model with those that were found
    follows the records better with the other one, or an error that matters has no name at all, the
    cell is searched with that, too: a fast pair that moves half a sample too late is a resistance
    several percent too large, and can hide what else there is. The better fit goes on, of the
    records fitted, each name paid for.
    """
    found = _with_holds(case, library)
    if case.otherwise is None or not _doubtful(found):
        return found
    other = _with_holds(case.otherwise._replace(otherwise=case), library)
    filters = found.rounds[-1].filters
    return min((found, other), key=lambda one: _cost(one, filters))


def _with_holds(case, library):
    """What a search under the hold of the case comes to, and its last model under either."""
    found = _beside_small(Searched(case, *decided(case, search(case, library))))
    return _by_both_holds(_without_outdone(_of_possible_sizes(found), library))


def _beside_small(found):
    """The same with what the last round found of a size nobody would act on, beside its names.

    Left out, it would be in their sizes: where discharges prevail, a resistance that falls by
    1 kJ/mol, which nobody acts on, is 0.2 mV/K of an entropic coefficient. One that drives a size
    of a name onto its bound is not told apart from that name.
    """
    case, rounds, result = found.case, found.rounds, found.result
    step = rounds[-1]
    small = beside_names(case, rounds[0].before, step) if result.steps else None
    if small is None:
        return found
    state, filters = small.state, step.filters
    refitted = case.state(state.effects, _fit_of(case, state, filters), filters)
    worse = np.sum(refitted.validation_chi_squares - step.before.validation_chi_squares) > 0
    pushed = set(refitted.solution.at_bound) - set(step.before.solution.at_bound)
    if worse or pushed & {name for one in result.steps for name in one.chosen.effect.names}:
        return found
    rounds = [*rounds[:-1], step._replace(before=refitted, small=(*step.small, small))]
    now = outcome(rounds, case.gates)
    now = now._replace(refused=result.refused, why_refused=result.why_refused)
    return found._replace(rounds=rounds, result=now, alone=step.before.solution)


def _of_possible_sizes(found):
    """The same up to the first name whose leading size is on its bound once all is refitted."""
    on_bound = set(found.result.last.solution.at_bound)
    steps = found.result.steps
    refused = next((one for one in steps if one.chosen.effect.names[0] in on_bound), None)
    if refused is None:
        return found
    rounds = up_to(found.rounds, refused)
    result = outcome(rounds, found.case.gates)._replace(refused=refused, why_refused=IMPOSSIBLE)
    return found._replace(rounds=rounds, result=result, alone=None)


def _without_outdone(found, library):
    """The same up to the first name in whose place a rival outside the vocabulary explains more.

    With such rivals as what is left in the end shows: beside a name that was outdone, or where
    more is left than anyone would accept.
    """
    rounds, result, shares = found.rounds, found.result, found.shares
    rivals = ((step, _rival_of(found, step, library)) for step in result.steps)
    step, rival = next((pair for pair in rivals if pair[1] is not None), (None, None))
    if rival is not None:
        rounds, why = up_to(rounds, step), OUTDONE.format(rival.sentence)
        result = outcome(rounds, found.case.gates)._replace(refused=step, why_refused=why)
        # What would have been a name is there, however little of it.
        result = result if result.steps else result._replace(word="unknown")
        shares = without_name(shares, (step.chosen.effect.id, *step.tied))
        found = Searched(found.case, rounds, result, shares)
    elif result.adequate:
        return found
    outside = _shown_outside(found, library)
    best = max((trial.j for trial in rounds[-1].trials), default=0.0)
    if any(trial.j > best for trial in outside):
        # Nor is a name likely that would explain less beside the last model.
        kept = {name for one in result.steps for name in (one.chosen.effect.id, *one.tied)}
        others = {one for answer in shares for one in answer.split(" + ")} - kept
        shares = without_name(shares, others - {"none"})
    return found._replace(outside=outside, shares=shares)


def _shown_outside(found, library):
    """Trials of what is outside the vocabulary and somebody would act on, beside the last model."""
    case, last, filters = found.case, found.result.last, found.rounds[-1].filters
    first = found.rounds[0].before
    trials = judged(case, last, _trials_outside(case, last, filters, library), filters)
    shown = (trial for trial in trials if significant(case.gates, trial))
    return tuple(t for t in shown if case.matters(first, last, t, found.result.floor))


def _rival_of(found, step, library):
    """The Effect outside the vocabulary that explains more than a name in its place, or None."""
    case, last, filters = found.case, found.result.last, found.rounds[-1].filters
    mine = step.chosen.effect
    others = last._replace(effects=tuple(one for one in last.effects if one is not mine))
    before = case.state(others.effects, _fit_of(case, others, filters), filters)
    named = trial_of(case, before, mine, last.effects, 0.0, last.solution, filters)
    trials = [named, *_trials_outside(case, before, filters, library)]
    best = judged(case, before, trials, filters)[0]
    return best.effect if best.effect is not mine and significant(case.gates, best) else None


def _trials_outside(case, before, filters, library):
    """Trials, not judged yet, of each effect outside the vocabulary beside a State."""
    trials = []
    for effect in OUTSIDE.values():
        # First of their stage: the heat of the core is that of the resistances in the end.
        effects = in_order((*before.effects, effect), OUTSIDE | library)
        values = before.solution.values | neutral(effect)
        begun = before._replace(effects=effects, solution=before.solution._replace(values=values))
        solution = _fit_of(case, begun, filters)
        trials.append(trial_of(case, before, effect, effects, 0.0, solution, filters))
    return trials


def _doubtful(found):
    """Whether the other hold may come to more."""
    if not found.result.steps:
        return not found.result.adequate
    return found.holds[1].cost < found.holds[0].cost


def _cost(found, filters):
    """Cost of the last model on the records fitted, by one noise, and what its names cost."""
    names = len(found.result.steps) * found.case.gates.bic
    return _fit_of(found.case, found.result.last, filters).cost + names


def _fit_of(case, state, filters):
    """The model of a state fitted to a case: Solution."""
    free = case.begun()[0]
    for effect in state.effects:
        free = case.with_effect(free, effect)
    return fit(case.problem(state.effects, free, filters), state.solution.values)


def _by_both_holds(found):
    """The same with the last model fitted under either hold, where it has effects."""
    case, last, filters = found.case, found.result.last, found.rounds[-1].filters
    if case.otherwise is None or not found.result.steps:
        return found
    holds = (_fit_of(one, last, filters) for one in (case, case.otherwise))
    return found._replace(holds=tuple(holds))


def _helping(rounds, result):
    """Rounds up to the first proven name without which other records are followed better.

    A choice is refitted with all rows anew; what helped as it was tried may not any more.
    """
    now = result.last.validation_rmse_volt
    for step in result.steps:
        if step.chosen.proven and now >= step.before.validation_rmse_volt:
            return up_to(rounds, step), step
    return rounds, None


def gap_closed(before_volt, after_volt, floor_volt):
    """Share of the gap that is closed [1]: 1 − (after² − floor²)/(before² − floor²).

    Above 1 where the model does better than the floor; None where there was no gap.
    """
    whole = before_volt**2 - floor_volt**2
    return None if whole <= 0 else float(1.0 - (after_volt**2 - floor_volt**2) / whole)


def verdict_of(name, result, rounds, place, *, next_test=None, not_testable=(), entry=None):
    """Verdict of a cell or group as dict of the contract.

    Parameters
    ----------
    name : of the cell or group. result : Outcome. rounds : list of search.Round.
    place : dict, where most of the error left lies, see `judge.worst`; None.
    next_test : sentence, or None. not_testable : ids.
    entry : function (round, state after it, outcome) → dict of one effect; None: `entry_of`.

    Returns
    -------
    verdict : dict, as in the contract; `partial` holds effects that
    explain part of an "unknown" gap, `small` keys of those that are in the model without a name.
    """
    entry = entry or entry_of
    after = {id(step): later.before for step, later in pairwise(rounds)}
    entries = [entry(step, after[id(step)], result) for step in result.steps]
    settled = result.word in ("named", "ambiguous")
    if result.word == "unknown" and result.refused is not None:
        after = result.refused.chosen.state
        entries = [entry(result.refused, after, result._replace(last=after))]
    first, last = rounds[0].before, result.last
    return {
        "cell": name,
        "verdict": result.word,
        "effects": entries if settled else [],
        "partial": [] if settled else entries,
        "located_at": None if result.adequate else place,
        "floor_volt": result.floor.validation_volt,
        "floors": [{"test": k, "volt": volt} for k, volt in result.floor.by_test.items()],
        "remainder": {"excess_volt": result.excess_volt, "adequate": result.adequate},
        "rmse_volt": {"before": first.rmse_volt, "after": last.rmse_volt},
        "validation_rmse_volt": {
            "before": first.validation_rmse_volt,
            "after": last.validation_rmse_volt,
        },
        "gap_closed": result.closed,
        "next_test": next_test,
        "not_testable": list(not_testable),
        "small": [trial.effect.key for trial in rounds[-1].small],
    }


def entry_of(step, after, result, parts=None):
    """Entry of one effect in a verdict: sizes at the end, errors before and after it, proof.

    Parameters
    ----------
    step : search.Round that chose it. after : candidates.State with it, from which the next round
    begins. result : Outcome. parts : (n,) number of the part of each row of the fit, see
    `records.parts_of`: errors of different parts are taken as independent. None: those of all rows.
    """
    effect, before, proof = step.chosen.effect, step.before, step.chosen.proof
    was, now = before.validation_rmse_volt, after.validation_rmse_volt
    final = result.last.solution
    deviations = stds(final, parts)
    return {
        "effect": effect.id,
        "alternatives": list(step.tied),
        "parameters": {
            p.name: {
                "value": float(final.values[name]),
                "std": deviations.get(name),
                "unit": p.unit,
                "at_bound": name in final.at_bound,
            }
            for p, name in zip(effect.parameters, effect.names, strict=True)
        },
        "rmse_volt": {"before": before.rmse_volt, "after": after.rmse_volt},
        "validation_rmse_volt": {"before": was, "after": now},
        "gap_closed": gap_closed(was, now, result.floor.validation_volt),
        "proof": "proven" if step.chosen.proven else "unproven",
        "blocks": proof._asdict() if proof else None,
        "delta_bic": step.chosen.delta_bic,
        "delta_validation_chi_square": step.chosen.delta_validation,
        # Whether the fitted records alone would have chosen it.
        "same_without_validation": max(step.trials, key=lambda t: t.delta_bic).effect == effect,
    }
