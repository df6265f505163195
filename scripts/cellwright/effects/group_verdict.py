"""From the rounds of a search in a group to the verdict of the contract."""

import numpy as np

from cellwright.effects.group_case import LOADED_C_RATE, gap_volt, predicted, rows_of
from cellwright.effects.group_model import group_fields, group_run
from cellwright.effects.group_std import std_of
from cellwright.effects.group_words import paragraph
from cellwright.effects.verdict import gap_closed

LOG_CURRENTS = "log the branch currents: the group's voltage alone tells no branch from another"
OTHER_TEMPERATURE = "repeat the group's drive at a chamber temperature 20 K away"
KELVIN = 5.0  # between mean temperatures of records, below which warm and low-ohmic are one
WARM = {"branch_cell_resistance", "branch_temperature"}
VISIBLE = 25.0  # fall of chi-square by an effect of plausible size
PARTS = 3


def group_verdict(group, case, rounds, library):
    """Verdict of a group.

    Parameters
    ----------
    group : name. case : GroupCase. rounds : list of GroupRound. library : dict of Effect by id.

    Returns
    -------
    verdict : dict of the contract; each effect has its `branch` (1 is the first), `cell`, and
    `branch_alternatives`, branches that explain as much by the same effect. `rmse_volt` is of the
    branch currents times their cells' ohmic resistance, of the voltage where none were logged:
    "before" is of the model that was fitted without the effect, bent towards it as far as the
    declared spread allows. What the last model would leave with its effects taken out is
    `without_effects_volt`.
    """
    steps = [one for one in rounds if one.chosen is not None][: case.gates.rounds]
    first, last, floor = rounds[0].before, rounds[-1].before, rounds[-1].floor_volt
    entries = [
        _entry(case, one, after, floor)
        for one, after in zip(steps, rounds[1 : len(steps) + 1], strict=True)
    ]
    closed = _closed(first, last, floor) if entries else None
    word, adequate = _word(case, entries, last, floor, closed)
    settled = word in ("named", "ambiguous")
    verdict = {
        "cell": group,
        "verdict": word,
        "effects": entries if settled else [],
        "partial": [] if settled else entries,
        "located_at": None if adequate else _located(case, last),
        "floor_volt": floor,
        "rmse_volt": {"before": first.gap_volt, "after": last.gap_volt},
        "validation_rmse_volt": {
            "before": first.validation_gap_volt,
            "after": last.validation_gap_volt,
        },
        "without_effects_volt": _without(case, last, [s.chosen.placed.name for s in steps]),
        "gap_closed": closed,
        "branch_currents": case.sensors,
        "next_test": _next_test(case, entries, library),
        "not_testable": _not_testable(case, rounds[0], library),
    }
    return verdict | {"paragraph": paragraph(verdict, library)}


def _closed(before, after, floor):
    return gap_closed(before.validation_gap_volt, after.validation_gap_volt, floor)


def _without(case, state, names):
    """Gaps of a model on both kinds of records with some of its effects taken out [V]."""
    found = {}
    for role, stack, soc, values in (
        ("fit", case.fit, case.fit_soc, state.solution.values),
        ("validation", case.validation, case.validation_soc, state.values_at_validation),
    ):
        left = rows_of(case, stack) - predicted(
            case, stack, soc, values | dict.fromkeys(names, 0.0), state.placed
        )
        found[role] = gap_volt(case, left)
    return found


def _word(case, entries, last, floor, closed):
    left, gates = max(last.gap_volt, last.validation_gap_volt), case.gates
    small = left <= max(gates.adequate_ratio * floor, gates.adequate_volt)
    if not entries:
        return ("none", True) if small or not case.sensors else ("unknown", False)
    adequate = small or (closed is not None and closed >= gates.adequate_closed)
    if not adequate and (closed is None or closed < gates.partial_closed):
        return "unknown", False
    open_ended = any(one["alternatives"] for one in entries) or not case.sensors
    return "ambiguous" if open_ended else "named", adequate


def _entry(case, one, following, floor):
    before, after, placed = one.before, following.before, one.chosen.placed
    name, p = placed.name, placed.effect.parameters[0]
    same = [t.branch + 1 for t in one.tied if t.effect.id == placed.effect.id]
    return {
        "effect": placed.effect.id,
        "alternatives": _alternatives(case, one),
        "branch": placed.branch + 1,
        "cell": case.cells[placed.branch].cell,
        "branch_alternatives": same,
        "parameters": {
            p.name: {
                "value": float(after.solution.values[name]),
                "std": std_of(case, after, name, following.noises),
                "unit": p.unit,
                "at_bound": name in after.solution.at_bound,
            },
            "branch": {"value": placed.branch + 1, "std": None, "unit": "1", "at_bound": False},
        },
        "rmse_volt": {"before": before.gap_volt, "after": after.gap_volt},
        "validation_rmse_volt": {
            "before": before.validation_gap_volt,
            "after": after.validation_gap_volt,
        },
        "gap_closed": _closed(before, after, floor),
        "delta_bic": one.chosen.delta_bic,
        "delta_validation_chi_square": one.chosen.delta_validation,
        "same_without_validation": _first_by_bic(one) == placed,
    }


def _first_by_bic(one):
    """What would have been chosen by the fitted records alone."""
    return max(one.trials, key=lambda trial: trial.delta_bic).placed


def _alternatives(case, one):
    """Ids of other effects that explain as much, or that these data cannot set apart."""
    chosen = one.chosen.placed.effect.id
    names = {t.effect.id for t in one.tied}
    if not case.sensors:
        names |= {score.placed.effect.id for score in one.scores}
    if chosen in WARM and not _two_temperatures(case):
        names |= WARM
    return sorted(names - {chosen})


def _two_temperatures(case):
    stack = case.fit
    means = [stack.celsius[stack.file == k].mean() for k in range(len(stack.first))]
    return np.ptp(means) >= KELVIN


def _next_test(case, entries, library):
    if not case.sensors:
        return LOG_CURRENTS
    tied = next((one for one in entries if one["alternatives"]), None)
    if tied is None:
        return None
    names = {tied["effect"], *tied["alternatives"]}
    if names >= WARM and not _two_temperatures(case):
        return OTHER_TEMPERATURE
    return f"{library[tied['effect']].shows}, beside {library[tied['alternatives'][0]].shows}"


def _not_testable(case, one, library):
    """Ids of effects that even at a plausible size would not show in any branch."""
    seen = set()
    for score in one.scores:
        size = score.placed.effect.parameters[0].plausible
        if score.information * size**2 >= VISIBLE:
            seen.add(score.placed.effect.id)
    return sorted(set(library) - seen)


def _located(case, state):
    """Where most of what is left on the validation records sits: record, branch, stretch."""
    stack, channels = case.validation, 1 + len(case.cells) if case.sensors else 1
    left = np.square(state.validation.reshape(channels, -1))
    ohm = [1.0] if not case.sensors else [0.0, *(cell.r_ohm[0] for cell in case.cells)]
    left = left * np.square(ohm)[:, None]
    places = [
        (float(left[b, rows].sum()), stack.tests[k], b, rows)
        for k in range(len(stack.first))
        for rows in np.array_split(np.flatnonzero(stack.file == k), PARTS)
        for b in range(channels)
    ]
    most, test, branch, rows = max(places, key=lambda place: place[0])
    values, placed = state.values_at_validation, state.placed
    soc = group_run(group_fields(case.cells, case.validation_soc, values, placed), stack).soc[rows]
    soc = soc[:, branch - 1] if branch else soc.mean(axis=1)
    return {
        "file": test,
        "branch": branch or None,
        "second": [float(stack.second[rows[0]]), float(stack.second[rows[-1]])],
        "soc": [float(np.clip(end, 0.0, 1.0)) for end in (soc.min(), soc.max())],
        "current": _current(stack.current_ampere[rows]),
        "temperature_celsius": [float(stack.celsius[rows].mean())],
        "share": most / max(float(left.sum()), 1e-30),
    }


def _current(ampere):
    """What flows most of the time."""
    least = LOADED_C_RATE * np.abs(ampere).max()
    many = {"discharge": ampere < -least, "charge": ampere > least, "rest": np.abs(ampere) <= least}
    return max(many, key=lambda name: many[name].sum())
