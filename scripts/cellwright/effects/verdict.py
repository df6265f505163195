"""From the rounds of a search to a verdict."""

from typing import NamedTuple

from cellwright.numerics.least_squares import stds


class Outcome(NamedTuple):
    """Result of a search in one word, and the errors behind it.

    word : "none", "named", "ambiguous" or "unknown". steps : rounds that chose an effect.
    last : State at the end. floor_volt : [V]. closed : share of the gap that is closed on the
    validation records, by all effects. adequate : the error left is within the gates.
    """

    word: str
    steps: tuple
    last: object
    floor_volt: float
    closed: float | None
    adequate: bool


def outcome(rounds, gates, *, adequate_volt=0.0, alternatives=lambda step: step.tied):
    """Outcome of the rounds of a search: its word, and what is left of the gap.

    Parameters
    ----------
    rounds : list of search.Round. gates : case.Gates or groups.case.GroupGates.
    adequate_volt : error that may be left, however small the noise [V].
    alternatives : function (round) → ids of effects that its data cannot tell from the choice.

    Returns
    -------
    outcome : Outcome.
    """
    first, last, floor = rounds[0].before, rounds[-1].before, rounds[-1].floor_volt
    steps = tuple(step for step in rounds if step.chosen is not None)[: gates.rounds]
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
    entry : function (round, state after it, floor) → dict of one effect; None: `entry_of`.

    Returns
    -------
    verdict : dict, as in the contract; `partial` holds effects that
    explain part of an "unknown" gap.
    """
    states = [step.before for step in rounds[1 : len(result.steps)]] + [result.last]
    entries = [
        (entry or entry_of)(step, after, result.floor_volt)
        for step, after in zip(result.steps, states, strict=False)
    ]
    settled = result.word in ("named", "ambiguous")
    first, last = rounds[0].before, result.last
    return {
        "cell": name,
        "verdict": result.word,
        "effects": entries if settled else [],
        "partial": [] if settled else entries,
        "located_at": None if result.adequate else place,
        "floor_volt": result.floor_volt,
        "rmse_volt": {"before": first.rmse_volt, "after": last.rmse_volt},
        "validation_rmse_volt": {
            "before": first.validation_rmse_volt,
            "after": last.validation_rmse_volt,
        },
        "gap_closed": result.closed,
        "next_test": next_test,
        "not_testable": list(not_testable),
    }


def entry_of(step, after, floor_volt):
    """Entry of one effect in a verdict: sizes, errors before and after, proof.

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
        # Whether the fitted records alone would have chosen it.
        "same_without_validation": max(step.trials, key=lambda t: t.delta_bic).effect == effect,
    }
