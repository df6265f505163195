"""From the rounds of a search to a verdict."""

from typing import NamedTuple

from cellwright.numerics.least_squares import stds


class Outcome(NamedTuple):
    """What a search came to.

    word : "none", "named", "ambiguous" or "unknown". steps : rounds that chose an effect.
    last : State at the end. floor_volt : [V]. closed : share of the gap that is closed on the
    validation records, by all effects. adequate : little enough is left.
    """

    word: str
    steps: tuple
    last: object
    floor_volt: float
    closed: float | None
    adequate: bool


def outcome(rounds, gates, *, adequate_volt=0.0, alternatives=lambda step: step.tied):
    """The word of the verdict, and what is left.

    Parameters
    ----------
    rounds : list of search.Round. gates : case.Gates or groups.case.GroupGates.
    adequate_volt : error that may be left, however small the noise [V].
    alternatives : function (round) → ids of what its data cannot tell from the choice.

    Returns
    -------
    outcome : Outcome.
    """
    first, last, floor = rounds[0].before, rounds[-1].before, rounds[-1].floor_volt
    steps = tuple(one for one in rounds if one.chosen is not None)[: gates.rounds]
    if not steps:
        most = max(gates.unknown_ratio * floor, gates.nothing_volt)
        word = "none" if first.worst_volt <= most else "unknown"
        return Outcome(word, (), first, floor, None, word == "none")
    closed = gap_closed(first.validation_rmse_volt, last.validation_rmse_volt, floor)
    small = last.worst_volt <= max(gates.adequate_ratio * floor, adequate_volt)
    adequate = small or (closed is not None and closed >= gates.adequate_closed)
    if not adequate and (closed is None or closed < gates.partial_closed):
        return Outcome("unknown", steps, last, floor, closed, False)
    word = "ambiguous" if any(alternatives(step) for step in steps) else "named"
    return Outcome(word, steps, last, floor, closed, adequate)


def gap_closed(before_volt, after_volt, floor_volt):
    """1 − (after² − floor²)/(before² − floor²): the share of the gap that is gone [1].

    Above 1 where the model does better than the floor; None where there was no gap.
    """
    whole = before_volt**2 - floor_volt**2
    return None if whole <= 0 else float(1.0 - (after_volt**2 - floor_volt**2) / whole)


def verdict_of(name, found, rounds, place, *, next_test=None, not_testable=(), entry=None):
    """The verdict file of the contract.

    Parameters
    ----------
    name : of the cell or group. found : Outcome. rounds : list of search.Round.
    place : dict, where most of what is left sits, see `judge.worst`; None.
    next_test : sentence, or None. not_testable : ids.
    entry : function (round, state after it, floor) → dict of one effect; None: `entry_of`.

    Returns
    -------
    verdict : dict, as in the contract; `partial` holds what an "unknown" gap is half explained by.
    """
    states = [one.before for one in rounds[1 : len(found.steps)]] + [found.last]
    entries = [
        (entry or entry_of)(step, after, found.floor_volt)
        for step, after in zip(found.steps, states, strict=False)
    ]
    settled = found.word in ("named", "ambiguous")
    first, last = rounds[0].before, found.last
    return {
        "cell": name,
        "verdict": found.word,
        "effects": entries if settled else [],
        "partial": [] if settled else entries,
        "located_at": None if found.adequate else place,
        "floor_volt": found.floor_volt,
        "rmse_volt": {"before": first.rmse_volt, "after": last.rmse_volt},
        "validation_rmse_volt": {
            "before": first.validation_rmse_volt,
            "after": last.validation_rmse_volt,
        },
        "gap_closed": found.closed,
        "next_test": next_test,
        "not_testable": list(not_testable),
    }


def entry_of(step, after, floor_volt):
    """What a verdict says of one effect.

    Parameters
    ----------
    step : search.Round that chose it. after : search.State with it, from which the next round
    begins. floor_volt : [V].
    """
    effect, before = step.chosen.effect, step.before
    was, now = before.validation_rmse_volt, after.validation_rmse_volt
    deviations = stds(after.solution)
    return {
        "effect": effect.id,
        "alternatives": list(step.tied),
        "parameters": {
            p.name: {
                "value": float(after.solution.values[name]),
                "std": deviations.get(name),
                "unit": p.unit,
                "at_bound": name in after.solution.at_bound,
            }
            for p, name in zip(effect.parameters, effect.names, strict=True)
        },
        "rmse_volt": {"before": before.rmse_volt, "after": after.rmse_volt},
        "validation_rmse_volt": {"before": was, "after": now},
        "gap_closed": gap_closed(was, now, floor_volt),
        "delta_bic": step.chosen.delta_bic,
        "delta_validation_chi_square": step.chosen.delta_validation,
        # Who would have been chosen by the fitted records alone.
        "same_without_validation": max(step.trials, key=lambda t: t.delta_bic).effect == effect,
    }
