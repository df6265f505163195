"""What the rounds of a search in a group tell: the verdict of the contract, in words."""

import numpy as np

from cellwright.effects.groups.case import error_volt, predicted, rows_of
from cellwright.effects.groups.model import group_fields, group_run
from cellwright.effects.records import LOADED_C_RATE
from cellwright.effects.story.words import Phrases, paragraph
from cellwright.effects.verdict import entry_of, outcome, verdict_of

BLOCKS = 4  # of each record


def std_of(case, state, name):
    """Standard deviation of a free parameter.

    The larger of two: the posterior's, widened by the scatter of whitened residuals; and that of
    sums over blocks of time, which holds where residuals hang together for longer than the noise
    model knows (an OCV a millivolt off moves branch currents for an hour).

    Parameters
    ----------
    case : groups.case.GroupCase. state : search.State. name : of the parameter.

    Returns
    -------
    std : in the parameter's unit.

    Source: K.-Y. Liang, S. Zeger, Biometrika 73 (1986) 13 (sums over clusters); the blocks' number
    b enters as b/(b − 1).
    """
    solution = state.solution
    place = solution.names.index(name)
    influence = np.linalg.solve(solution.precision, np.eye(len(solution.names))[place])
    white = solution.whitened
    scatter = max(float(np.mean(white**2)), 1.0)
    moved = (solution.white @ influence) * white
    number = _blocks(case.fit)
    many = len(moved) // len(number)  # channels
    sums = np.bincount(np.tile(number, many), moved)
    between = float(np.sum((sums - sums.mean()) ** 2)) * len(sums) / (len(sums) - 1)
    return float(np.sqrt(max(influence[place] * scatter, between)))


def _blocks(stack):
    """Number of the block of each row: each record in so many parts of alike length."""
    part = np.zeros(len(stack.file), int)
    for k in range(len(stack.first)):
        rows = np.flatnonzero(stack.file == k)
        part[rows] = BLOCKS * k + BLOCKS * np.arange(len(rows)) // len(rows)
    return part


BLIND = (
    "Branch currents were not logged, and the group's voltage alone tells no branch from another: "
    "a name is only what would explain that voltage, and a fault of a branch's sensor cannot show."
)
HEALTHY = "healthy cells within the declared spread are off by"


def group_paragraph(verdict, library):
    """A paragraph for people about one group.

    Parameters
    ----------
    verdict : dict, as `group_verdict` makes it. library : dict of Effect by id.

    Returns
    -------
    text : str.
    """
    logged = verdict["branch_currents"]
    what = "branch currents (each times its cell's resistance)" if logged else "the group's voltage"
    where = f"in {what} of tests that took no part in the fit"
    text = paragraph(verdict, library, Phrases(where, HEALTHY, "no effect of one branch"))
    return text if logged else f"{text}\n{BLIND}"


LOG_CURRENTS = "log the branch currents: the group's voltage alone tells no branch from another"
OTHER_TEMPERATURE = "repeat the group's drive at a chamber temperature 20 K away"
KELVIN = 5.0  # between mean temperatures of records, below which warm and low-ohmic are one
WARM = {"branch_cell_resistance", "branch_temperature"}
PARTS = 3


def group_verdict(group, case, rounds, library):
    """Verdict of a group.

    Parameters
    ----------
    group : name. case : GroupCase. rounds : list of search.Round. library : dict of Effect by id.

    Returns
    -------
    verdict : dict of the contract; each effect has its `branch` (1 is the first), `cell`, and
    `branch_alternatives`, branches that explain as much by the same effect. `rmse_volt` is of the
    branch currents times their cells' ohmic resistance, of the voltage where none were logged:
    "before" is of the model that was fitted without the effect, bent towards it as far as the
    declared spread allows. What the last model would leave with its effects taken out is
    `without_effects_volt`.
    """
    found = outcome(
        rounds,
        case.gates,
        adequate_volt=case.gates.adequate_volt,
        alternatives=lambda step: _alternatives(case, step),
    )
    if found.word == "unknown" and not found.steps and not case.sensors:
        found = found._replace(word="none", adequate=True)
    verdict = verdict_of(
        *(group, found, rounds, _located(case, found.last)),
        next_test=_next_test(case, found.steps, library),
        not_testable=sorted(set(library) - _visible(rounds[0])),
        entry=lambda step, after, floor: _entry(case, step, after, floor),
    )
    names = [name for step in found.steps for name in step.chosen.effect.names]
    verdict |= {
        "without_effects_volt": _without(case, found.last, names),
        "branch_currents": case.sensors,
    }
    return verdict | {"paragraph": group_paragraph(verdict, library)}


def _without(case, state, names):
    """Errors of a model on both kinds of records with some of its effects taken out [V]."""
    errors = {}
    for role, stack, soc, values in (
        ("fit", case.fit, case.fit_soc, state.solution.values),
        ("validation", case.validation, case.validation_soc, state.values),
    ):
        absent = values | dict.fromkeys(names, 0.0)
        without = predicted(case, stack, soc, absent, state.effects)
        errors[role] = error_volt(case, rows_of(case, stack) - without)
    return errors


def _entry(case, step, after, floor):
    effect, branch = step.chosen.effect, step.chosen.effect.position
    entry = entry_of(step, after, floor)
    for p, name in zip(effect.parameters, effect.names, strict=True):
        entry["parameters"][p.name]["std"] = std_of(case, after, name)
    entry["parameters"]["branch"] = {
        **{"value": branch + 1, "std": None},
        **{"unit": "1", "at_bound": False},
    }
    tied = [t.effect for t in step.trials if t.effect.key in step.tied]
    return entry | {
        "alternatives": _alternatives(case, step),
        "branch": branch + 1,
        "cell": case.cells[branch].cell,
        "branch_alternatives": [one.position + 1 for one in tied if one.id == effect.id],
    }


def _alternatives(case, step):
    """Ids of other effects that explain as much, or that these data cannot set apart."""
    chosen = step.chosen.effect.id
    names = {t.effect.id for t in step.trials if t.effect.key in step.tied}
    if not case.sensors:
        names |= {score.candidate.effect.id for score in step.scores}
    if chosen in WARM and not _two_temperatures(case):
        names |= WARM
    return sorted(names - {chosen})


def _two_temperatures(case):
    stack = case.fit
    means = [stack.celsius[stack.file == k].mean() for k in range(len(stack.first))]
    return np.ptp(means) >= KELVIN


def _next_test(case, steps, library):
    if not case.sensors:
        return LOG_CURRENTS
    tied = next((step for step in steps if _alternatives(case, step)), None)
    if tied is None:
        return None
    chosen, (other, *_) = tied.chosen.effect.id, _alternatives(case, tied)
    if {chosen, *_alternatives(case, tied)} >= WARM and not _two_temperatures(case):
        return OTHER_TEMPERATURE
    return f"{library[chosen].shows}, beside {library[other].shows}"


def _visible(step):
    """Ids of effects that at a plausible size would show in some branch."""
    effects = [score.candidate.effect for score in step.scores]
    return {one.id for one in effects if one.key not in step.hidden}


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
    values, effects = state.values, state.effects
    soc = group_run(group_fields(case.cells, case.validation_soc, values, effects), stack).soc[rows]
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
