"""From the rounds of a search in a group to the verdict of the contract, in words."""

import numpy as np

from cellwright.effects.groups.case import LOADED_C_RATE, filters_of, gap_volt, predicted, rows_of
from cellwright.effects.groups.model import group_fields, group_run
from cellwright.effects.verdict import gap_closed, millivolt, name_of, number

BLOCKS = 4  # of each record


def std_of(case, state, name, noises):
    """Standard deviation of a free parameter.

    The larger of two: the posterior's, widened by the scatter of whitened residuals; and that of
    sums over blocks of time, which holds where residuals hang together for longer than the noise
    model knows (an OCV a millivolt off moves branch currents for an hour).

    Parameters
    ----------
    case : group_case.GroupCase. state : group_case.GroupState, its chart made at its values.
    name : of the parameter. noises : tuple of noise.Noise that its solution was found with.

    Returns
    -------
    std : in the parameter's unit.

    Source: K.-Y. Liang, S. Zeger, Biometrika 73 (1986) 13 (sums over clusters); the blocks' number
    b enters as b/(b − 1).
    """
    solution = state.solution
    place = solution.names.index(name)
    influence = np.linalg.solve(solution.chart.precision, np.eye(len(solution.names))[place])
    white = filters_of(case.fit, noises).apply(state.residual)
    scatter = max(float(np.mean(white**2)), 1.0)
    moved = (solution.chart.white @ influence) * white
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


SHARED = "each current times its cell's resistance"
BLIND = (
    "Branch currents were not logged, and the group's voltage alone tells no branch from another: "
    "a name is only what would explain that voltage, and a fault of a branch's sensor cannot show."
)


def paragraph(verdict, library):
    """A paragraph for people about one group.

    Parameters
    ----------
    verdict : dict, as `group_verdict.group_verdict` makes it. library : dict of Effect by id.

    Returns
    -------
    text : str.
    """
    opening = {"none": _none, "unknown": _unknown}.get(verdict["verdict"], _named)
    parts = [opening(verdict, library), *_remainder(verdict)]
    if not verdict["branch_currents"]:
        parts.append(BLIND)
    if verdict["next_test"]:
        parts.append(f"To test next: {verdict['next_test']}.")
    return " ".join(parts)


def _what(verdict):
    return f"branch currents ({SHARED})" if verdict["branch_currents"] else "the group's voltage"


def _none(verdict, library):
    return (
        "Nothing is missing that these data could show: healthy cells within the declared spread "
        f"explain {_what(verdict)} of tests that took no part in the fit to "
        f"{millivolt(verdict['validation_rmse_volt']['before'])}, and the noise alone is "
        f"{millivolt(verdict['floor_volt'])}."
    )


def _unknown(verdict, library):
    both = verdict["validation_rmse_volt"]
    text = (
        f"Something is missing that the library does not know: in {_what(verdict)} of tests that "
        f"took no part in the fit, healthy cells within the declared spread leave "
        f"{millivolt(both['before'])} where the noise is {millivolt(verdict['floor_volt'])}"
    )
    if not verdict["partial"]:
        return f"{text}, and no effect of one branch explains it."
    names = [f"{library[e['effect']].sentence} (branch {e['branch']})" for e in verdict["partial"]]
    return (
        f"{text}. The nearest explanation ({'; '.join(names)}) leaves {millivolt(both['after'])} "
        f"and so is not the name of it."
    )


def _named(verdict, library):
    both = verdict["validation_rmse_volt"]
    steps = " Then: ".join(_step(one, library) for one in verdict["effects"])
    changes = [library[one["effect"]].consequence for one in verdict["effects"]]
    return (
        f"{steps[0].upper()}{steps[1:]} All in all the error in {_what(verdict)} of tests that "
        f"took no part in the fit fell from {millivolt(both['before'])} (healthy cells within the "
        f"declared spread) to {millivolt(both['after'])}; the noise is "
        f"{millivolt(verdict['floor_volt'])}. What it changes: {'; '.join(dict.fromkeys(changes))}."
    )


def _step(one, library):
    name, p = next(iter(one["parameters"].items()))
    size = f"{name_of(name, p['unit'])} {number(p)}"
    text = f"in branch {one['branch']} ({one['cell']}) {library[one['effect']].sentence} ({size})."
    if one["alternatives"]:
        others = "; or ".join(library[name].sentence for name in one["alternatives"])
        text += f" These data cannot tell it from: {others}."
    if one["branch_alternatives"]:
        others = " or ".join(str(branch) for branch in one["branch_alternatives"])
        text += f" As well it could be branch {others}."
    if p["at_bound"]:
        text += " Its size ended on a bound: take it with care."
    if not one["same_without_validation"]:
        text += " The fitted tests alone would have named another effect: not a clear case."
    return text


def _remainder(verdict):
    place = verdict["located_at"]
    if place is None:
        return []
    low, high = (round(100 * soc) for soc in place["soc"])
    branch = f"branch {place['branch']} in " if place["branch"] else ""
    return [
        f"What is left sits mostly ({100 * place['share']:.0f} % of it) in "
        f"{branch}{place['file']}, {low} to {high} % state of charge, {place['current']}, "
        f"at {place['temperature_celsius'][0]:.0f} °C."
    ]


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
