"""From a search to a verdict: which effects have a name, and whether something is left unknown."""

from typing import NamedTuple

from cellwright.effects.floor import excess_of_blocks, fallen_on_volt, fallen_volt
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.story.sizes import has_size
from cellwright.numerics.compare import compare

# ASSUME: Other cells are like those of two sets by other simulators (docs/missing-effect.md): 36 of
# 37 names that stood alone were right (at least 0.88 with 95 %), and 6 of 10 beside another. The
# significance of a gain does not change this: all wrong names passed six standard errors by ranks.
RIGHT_ALONE, RIGHT_BESIDE = 0.9, 0.6
# Why an effect that is in a model has no name, as codes of `story/messages.toml`.
UNEVEN, SMALL, NO_SIZE, ONE_PART = "uneven", "small", "no_size", "one_part"
NO_NAME, CONTRADICTED = "no_name", "contradicted"


class Outcome(NamedTuple):
    """Result of a search in one word, and the errors behind it.

    word : "none", "named", "ambiguous" or "unknown". names : tuple of search.Beside, effects with a
    name, in order of addition. unnamed : tuple of (Beside, code of why), effects in the model
    without one. last : State at the end, of all effects of the model; of "none" that of the plain
    model. alone : State with those that have a name alone. floor : floor.Floor. closed : share of
    the gap that it closes on the validation records. excess_volt : error that is left beyond the
    floor, of "unknown" by the names alone, of the side, fit or proof, where it is larger.
    adequate : nobody would act on that.
    """

    word: str
    names: tuple
    unnamed: tuple
    last: object
    alone: object
    floor: object
    closed: float | None
    excess_volt: float
    adequate: bool


def outcome(found, fitted, values=None):
    """Outcome of a search.

    1. A name is an effect of the vocabulary whose gain is `counts` standard errors by its ranks,
       beside all others; which takes off the error of either side what somebody acts on; whose
       size is told and acted on, see `has_size`; and which not a single block asks for, see
       `search.Search.gain_elsewhere`.
    2. Unknown is what is left beyond `unknown_volt`, if nothing has a name, or if the names leave
       more than `unknown_share` of what was left without them.

    Parameters
    ----------
    found : search.Search. fitted : sizes.Fitted of its last model. values : of that, as in
        `sizes.sizes_as_used`; None: its parameters alone.
    """
    gates, names, unnamed = found.case.gates, [], []
    for one in found.beside:
        why = _against(found, one, fitted, values)
        if why:
            unnamed.append((one, why))
        else:
            names.append(one)
    alone = found.with_only([one.effect for one in names]) if names else found.first
    was, left = (_left(found, state) for state in (found.first, alone))
    word = "ambiguous" if any(one.tied for one in names) else "named"
    if not names:
        word = "none" if left <= gates.unknown_volt else "unknown"
    elif left > max(gates.unknown_volt, gates.unknown_share * was):
        word = "unknown"
    # What a whole model leaves is told of names that are enough; an unknown is what they leave.
    last = found.first if word == "none" else found.last
    left = _left(found, alone if word == "unknown" else last)
    first, floor = found.first.validation_rmse_volt, found.floor.validation_volt
    closed = gap_closed(first, last.validation_rmse_volt, floor) if names else None
    adequate = left <= gates.unknown_volt
    about = tuple(names), tuple(unnamed), last, alone, found.floor, closed, left, adequate
    return Outcome(word, *about)


def _left(found, state):
    """Error of a state beyond the floor, each block once, of the side where it is larger [V]."""
    return excess_of_blocks(found.case, state, found.floor, found.filters)


def _against(found, one, fitted, values):
    """Why an effect that is in a model has no name, as a code; "": it has one."""
    case, last = found.case, found.last
    if one.gain.rank_z < case.gates.counts:
        return UNEVEN
    if fallen_volt(one.before, last, found.floor) < case.gates.material_volt:
        return SMALL
    if not has_size(one.effect, last.solution, values or last.solution.values, fitted):
        return NO_SIZE
    if one.effect.id in OUTSIDE:
        return NO_NAME
    return "" if found.gain_elsewhere(one).rank_z >= case.gates.elsewhere else ONE_PART


def gap_closed(before_volt, after_volt, floor_volt):
    """Share of the gap that is closed [1]: 1 − (after² − floor²)/(before² − floor²).

    Above 1 where the model does better than the floor; None where there was no gap.
    """
    whole = before_volt**2 - floor_volt**2
    return None if whole <= 0 else float(1.0 - (after_volt**2 - floor_volt**2) / whole)


def verdict_of(name, found, result, place, deviations, *, next_test=None, not_testable=()):
    """Verdict of a cell or group as dict of the contract.

    Parameters
    ----------
    name : of the cell or group. found : search.Search. result : Outcome of it.
    place : dict, where most of the error left lies, see `judge.worst`; None.
    deviations : of the parameters of its last model, by name. next_test : sentence, or None.
    not_testable : ids.

    Returns
    -------
    verdict : dict, as in the contract; `partial` holds effects that explain part of an "unknown"
    gap, `small` keys of those that are in the model without a name. `errors` : of the plain model,
    of its names alone, and of the whole model, of training and validation records [V].
    """
    entries = [_entry(found, one, result, deviations) for one in result.names]
    settled = result.word in ("named", "ambiguous")
    first, last = found.first, result.last
    nameless = result.unnamed if result.word != "none" else ()
    nameless = [one.effect.key for one, _ in nameless if one.effect.id not in OUTSIDE]
    return {
        "cell": name,
        "verdict": result.word,
        "effects": entries if settled else [],
        "partial": [] if settled else entries,
        "located_at": None if result.adequate else place,
        "floor_volt": result.floor.validation_volt,
        "floors": [{"test": k, "volt": volt} for k, volt in result.floor.by_test.items()],
        "remainder": {"excess_volt": result.excess_volt, "adequate": result.adequate},
        **_before_and_after(first, last),
        "errors": {
            name: {"fit_volt": state.rmse_volt, "validation_volt": state.validation_rmse_volt}
            for name, state in (("plain", first), ("names", result.alone), ("model", found.last))
        },
        "gap_closed": result.closed,
        "next_test": next_test,
        "not_testable": list(not_testable),
        "against": {one.effect.key: why for one, why in result.unnamed},
        "small": nameless,
        "outside": [_outside(one, deviations) for one in shown_outside(found, result)],
    }


def shown_outside(found, result):
    """Beside of what the records show and the vocabulary has no name for, tuple."""
    return tuple(one for one, why in result.unnamed if why == NO_NAME)


def _errors(one):
    """Errors of a model without and with one of its effects, on both kinds of records."""
    return _before_and_after(one.before, one.state)


def _before_and_after(*ends):
    names = {"fit": "rmse_volt", "validation": "validation_rmse_volt"}
    return {
        name: {"before": ends[0].rmse_on(side), "after": ends[1].rmse_on(side)}
        for side, name in names.items()
    }


def _entry(found, one, result, deviations):
    """Entry of one effect in a verdict: sizes, errors without and with it beside the others."""
    solution, errors = one.state.solution, _errors(one)
    both = errors["validation_rmse_volt"]
    return {
        "effect": one.effect.id,
        "alternatives": list(one.tied),
        "parameters": _parameters(one.effect, solution, deviations),
        **errors,
        "gap_closed": gap_closed(both["before"], both["after"], result.floor.validation_volt),
        "proof": "proven" if is_proven(found, one) else "unproven",
        "gain": one.gain._asdict(),
        "probability": RIGHT_ALONE if len(result.names) == 1 else RIGHT_BESIDE,
    }


def _parameters(effect, solution, deviations):
    return {
        p.name: {
            "value": float(solution.values[name]),
            "std": deviations.get(name),
            "unit": p.unit,
            "at_bound": name in solution.at_bound,
        }
        for p, name in zip(effect.parameters, effect.names, strict=True)
    }


def sizes_of_names(result, deviations):
    """Names of an outcome with their parameters, as entries of a verdict have them: list of dict.

    Parameters
    ----------
    result : Outcome. deviations : of the parameters of its last model, by name.
    """
    return [
        {
            "effect": one.effect.id,
            "parameters": _parameters(one.effect, one.state.solution, deviations),
        }
        for one in result.names
    ]


def is_proven(found, one):
    """Whether the validation records show an effect by themselves: surely, and in its size."""
    case, blocks = found.case, found.yardstick.blocks
    judges, states = blocks.judges, (one.before, one.state)
    ends = (found.yardstick.density(squares)[judges] for squares in one.squares)
    return (
        fallen_on_volt("validation", *states, found.floor) >= case.gates.material_volt
        and compare(*ends, record=blocks.record[judges]).z >= case.gates.joins
    )


def _outside(one, deviations):
    """What the vocabulary has no name for: its size, and errors without and with it."""
    (p, *_), (name, *_) = one.effect.parameters, one.effect.names
    value = float(one.state.solution.values[name])
    size = {"value": value, "std": deviations[name]}
    return {"effect": one.effect.id, "parameter": p.name, "unit": p.unit} | size | _errors(one)
