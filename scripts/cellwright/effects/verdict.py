"""From the rounds of a search to a verdict: none, named, ambiguous or unknown."""

from typing import NamedTuple

from cellwright.effects.problem import stds
from cellwright.effects.residual_map import worst


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


def outcome(rounds, gates):
    """The word of the verdict, and what is left.

    Parameters
    ----------
    rounds : list of search.Round. gates : case.Gates.

    Returns
    -------
    outcome : Outcome.
    """
    first, last = rounds[0].before, rounds[-1].before
    floor = rounds[0].floor_volt
    steps = tuple(one for one in rounds if one.chosen is not None)[: gates.rounds]
    if not steps:
        most = max(gates.unknown_ratio * floor, gates.nothing_volt)
        word = "none" if first.worst_volt <= most else "unknown"
        return Outcome(word, (), first, floor, None, word == "none")
    closed = gap_closed(first.validation_rmse_volt, last.validation_rmse_volt, floor)
    small = last.worst_volt <= gates.adequate_ratio * floor
    adequate = small or closed >= gates.adequate_closed
    if not adequate and closed < gates.partial_closed:
        return Outcome("unknown", steps, last, floor, closed, False)
    word = "ambiguous" if any(step.tied for step in steps) else "named"
    return Outcome(word, steps, last, floor, closed, adequate)


def gap_closed(before_volt, after_volt, floor_volt):
    """1 − (after² − floor²)/(before² − floor²): the share of the gap that is gone [1].

    Above 1 where the model does better than the floor; None where there was no gap.
    """
    whole = before_volt**2 - floor_volt**2
    return None if whole <= 0 else float(1.0 - (after_volt**2 - floor_volt**2) / whole)


def verdict_of(cell, found, gates, rounds, left, *, next_test=None, not_testable=()):
    """The verdict file of the contract.

    Parameters
    ----------
    cell : name. found : Outcome. gates : case.Gates. rounds : list of search.Round.
    left : dict of columns of the residual map, with what is left after the last step.
    next_test : sentence, or None. not_testable : ids.

    Returns
    -------
    verdict : dict, as in the contract; `partial` holds what an "unknown" gap is half explained by.
    """
    entries = [
        _entry(step, after, found.floor_volt)
        for step, after in zip(found.steps, _states_after(found, rounds), strict=True)
    ]
    settled = found.word in ("named", "ambiguous")
    first, last = rounds[0].before, found.last
    return {
        "cell": cell,
        "verdict": found.word,
        "effects": entries if settled else [],
        "partial": [] if settled else entries,
        "located_at": None if found.adequate else worst(left, found.floor_volt),
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


def _states_after(found, rounds):
    """The state after each step: that from which the next round begins."""
    return (
        [one.before for one in rounds[1 : len(found.steps)]] + [found.last] if found.steps else []
    )


def _entry(step, after, floor):
    effect, before = step.chosen.effect, step.before
    was, now = before.validation_rmse_volt, after.validation_rmse_volt
    deviations = stds(after.solution)
    return {
        "effect": effect.id,
        "alternatives": list(step.tied),
        "parameters": {
            p.name: {
                "value": float(after.solution.values[f"{effect.id}.{p.name}"]),
                "std": deviations.get(f"{effect.id}.{p.name}"),
                "unit": p.unit,
                "at_bound": f"{effect.id}.{p.name}" in after.solution.at_bound,
            }
            for p in effect.parameters
        },
        "rmse_volt": {"before": before.rmse_volt, "after": after.rmse_volt},
        "validation_rmse_volt": {"before": was, "after": now},
        "gap_closed": gap_closed(was, now, floor),
        "delta_bic": step.chosen.delta_bic,
        "delta_validation_chi_square": step.chosen.delta_validation,
        "same_without_validation": _first_by_bic(step) == effect.id,
    }


def _first_by_bic(step):
    """Who would have been chosen by the fitted records alone."""
    return max(step.trials, key=lambda trial: trial.delta_bic).effect.id
