"""The whole search for one cell: from its tests to a verdict and all that a report shows of it."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain, ties
from cellwright.effects.case import Gates, filters_of, not_excited, steep
from cellwright.effects.judge import joined, residual_map, worst
from cellwright.effects.member import folds
from cellwright.effects.paired import Pairing, paired
from cellwright.effects.planner import next_test
from cellwright.effects.prepare import prepared
from cellwright.effects.screen import evidence
from cellwright.effects.search import frees_of, search
from cellwright.effects.story.places import worsened
from cellwright.effects.story.words import explained, paragraph
from cellwright.effects.ties import tie_of
from cellwright.effects.verdict import outcome, verdict_of
from cellwright.effects.witnesses.collected import values_of
from cellwright.numerics.least_squares import stds
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal

KEPT = ("named", "ambiguous")  # verdicts whose effects go into the model


class Finding(NamedTuple):
    """What a search found.

    verdict : dict of the contract. ranking, residual_map, evidence, series, confounding, menu :
    dicts of columns. model : dict, all that `base.voltage` needs. notes : tuple of str.
    """

    verdict: dict
    ranking: dict
    residual_map: dict
    evidence: dict
    series: dict
    confounding: dict
    menu: dict
    model: dict
    notes: tuple


class Reference(NamedTuple):
    """A healthy cell of the type: CellFacts, its basis, a list of MeasuredTest."""

    cell: CellFacts
    basis: dict
    tests: list


def missing_effect(cell, basis, tests, library, *, settings, references=()):
    """Search a cell for what the plain model lacks.

    Parameters
    ----------
    cell : CellFacts. basis : dict, from `basis.basis`.
    tests : list of MeasuredTest. library : dict of Effect by id.
    settings : dict: those of `settings_of`, most_rows and split_rest_second.
    references : sequence of Reference. Where three or more ran the same protocol, and the plain
    model fails them by far more than noise, the cell is held against them (paired mode).

    Returns
    -------
    finding : Finding.

    Raises
    ------
    Refusal : no OCV, nothing to fit, or nothing that judges.
    """
    gates, tolerance = settings_of(settings)
    options = {"tolerance": tolerance, "gates": gates, "settings": settings}
    ready = prepared(cell, basis, tests, **options)
    case, beside, note = _beside(ready.case, references, options)
    found = of_case(cell.cell, case, library, split_rest_second=settings["split_rest_second"])
    said = "\n".join([found.verdict["paragraph"], *ready.caveats])
    verdict = found.verdict | {"references": beside, "paragraph": said}
    return found._replace(verdict=verdict, notes=(*ready.notes, *note, *found.notes))


def _beside(case, references, options):
    """The case in paired mode where that serves: (case, names of the references, notes)."""
    if len(references) < Pairing().references:
        return case, [], ()
    try:
        others = {one.cell.cell: prepared(*one, **options).case for one in references}
        pair = paired(case, others)
    except Refusal as refusal:
        return case, [], (f"searched alone, not beside the references: {refusal}",)
    if not pair.needed:
        return case, [], ("searched alone: the plain model follows the references to the noise",)
    names = ", ".join(pair.references)
    return pair.case, list(pair.references), (f"searched beside the references {names}",)


def settings_of(settings):
    """Gates and tolerances from the settings of a campaign, by their names."""
    gates = Gates(**{name: settings[name] for name in Gates._fields if name in settings})
    known = {f"{name}_tolerance": name for name in plain.Tolerance._fields}
    given = {known[name]: value for name, value in settings.items() if name in known}
    return gates, plain.Tolerance(**given)


def of_case(name, case, library, *, split_rest_second=None):
    """As `missing_effect`, for a case that stands already.

    split_rest_second : shortest rest that ends a block [s]; None: the model is not fitted again
    without blocks, which only a choice between models asks for.
    """
    rounds = search(case, library)
    found = outcome(rounds, case.gates)
    left = _map(case, rounds[0].before, found.last)
    unexcited = {e.id: not_excited(case, e) for e in library.values()}
    named = {step.chosen.effect.id for step in found.steps}
    hidden = set.intersection(*(set(one.hidden) for one in rounds)) - named
    hidden |= {name for name in library if tie_of(name) is not None}
    untestable = sorted({n for n, why in unexcited.items() if why} | hidden)
    menu, advice = _advised(case, found, rounds, library, untestable)
    place = worst(left, found.floor_volt)
    verdict = verdict_of(name, found, rounds, place, next_test=advice, not_testable=untestable)
    shown = _evidence(case, found)
    shares = explained(shown)
    for one in (*verdict["effects"], *verdict["partial"]):
        one["explained"] = shares.get(one["effect"])
    verdict["worsened"] = worsened(left)
    kept = bool(found.steps) and found.word in KEPT
    model = model_of(case, found.last if kept else rounds[0].before)
    verdict["paragraph"] = paragraph(verdict, library, values=values_of(model))
    if kept and split_rest_second is not None:
        again = {"split_rest_second": split_rest_second}
        model["folds"] = folds(case, found.last, rounds[-1].noise, **again)
    return Finding(
        verdict,
        ranking_of(rounds),
        left,
        shown,
        _series(case, rounds[0].before, found.last),
        _confounding(case, rounds, library),
        menu,
        model,
        tuple(f"{n} cannot be told: needs {', '.join(w)}" for n, w in unexcited.items() if w),
    )


def _advised(case, found, rounds, library, untestable):
    """The menu of next tests, and the sentence: for a tie, else for what could not be told."""
    tied = next((s for s in found.steps if s.tied), None)
    if tied is not None:
        after = tied.chosen.state
        advice = next_test(case, after, tied.chosen.effect.id, tied.tied, library=library)
        return advice.table, advice.sentence
    # Of what could not be told, resistance over temperature is what most cells have.
    if found.word != "none" or "resistance_temperature" not in untestable:
        return {}, None
    advice = next_test(case, found.last, "resistance_temperature", library=library)
    return advice.table, advice.sentence


def _map(case, before, after):
    return joined(
        [
            _map_of(case, case.fit, "fit", before, after),
            _map_of(case, case.validation, "validation", before, after),
        ]
    )


def _map_of(case, stack, role, before, after):
    values = [s.solution.values if role == "fit" else s.values for s in (before, after)]
    fields = base.fields_of(case.cell, stack, values[1], after.effects)
    left = [s.solution.residual if role == "fit" else s.validation for s in (before, after)]
    capacity = case.cell.capacity_ampere_hour
    return residual_map(stack, role, fields.soc, *left, capacity, stack.used)


def ranking_of(rounds):
    """Every candidate that was refitted, round by round: dict of columns.

    Parameters
    ----------
    rounds : list of search.Round.
    """
    rows = [
        {"round": number} | _ranked(trial, one)
        for number, one in enumerate(rounds, 1)
        for trial in one.trials
    ]
    return _columns(rows)


def _ranked(trial, one):
    effect, solution = trial.effect, trial.state.solution
    names = [free.name for free in frees_of(effect)]
    row = {"effect": effect.id}
    if effect.position is not None:
        row |= {"branch": effect.position + 1, "value": solution.values[effect.names[0]]}
    return row | {
        "parameters_counted": len(names),
        "score_chi_square": trial.score,
        "delta_bic": trial.delta_bic,
        "delta_validation_chi_square": trial.delta_validation,
        "rmse_volt": trial.state.rmse_volt,
        "validation_rmse_volt": trial.state.validation_rmse_volt,
        "j": trial.j,
        "in_range": not set(names) & set(solution.at_bound),
        "chosen": trial is one.chosen,
        "tied": effect.key in one.tied,
    }


def _columns(rows):
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {}


def _evidence(case, found):
    """Of each effect that was named: residual before it over what it changes."""
    parts = []
    for step in found.steps:
        effect, after = step.chosen.effect, step.chosen.state.solution.values
        sizes = {p.name for p in effect.parameters if not p.shape}
        neutral = after | {
            f"{effect.id}.{p.name}": p.neutral for p in effect.parameters if p.name in sizes
        }
        effects = step.chosen.state.effects
        volts = [base.voltage(case.cell, case.fit, v, effects) for v in (after, neutral)]
        filters = filters_of(case, step.noise, steep(case, after))
        change = (volts[0] - volts[1])[:, None]
        one = evidence(step.before, change, np.ones(1), step.before.solution.residual, filters.fit)
        parts.append({"effect": [effect.id] * len(one["rows"])} | one)
    return joined(parts)


def _series(case, before, after):
    parts = []
    for role, stack in (("fit", case.fit), ("validation", case.validation)):
        values = after.solution.values if role == "fit" else after.values
        fields = base.fields_of(case.cell, stack, values, after.effects)
        left = [s.solution.residual if role == "fit" else s.validation for s in (before, after)]
        parts.append(
            {
                "role": [role] * len(stack.file),
                "test": [stack.tests[k] for k in stack.file],
                "test_time_second": stack.second.tolist(),
                "current_ampere": stack.current_ampere.tolist(),
                "celsius": stack.celsius.tolist(),
                "soc": fields.soc.tolist(),
                "used": stack.used.tolist(),
                "voltage_volt": stack.voltage_volt.tolist(),
                "before_volt": (stack.voltage_volt - left[0]).tolist(),
                "after_volt": (stack.voltage_volt - left[1]).tolist(),
            }
        )
    return joined(parts)


def _confounding(case, rounds, library):
    model = ties.model_of(rounds[0].before)
    return ties.confounding(ties.shown(case, library, model, spread=rounds[0].noise))


def model_of(case, state):
    """A model with its effects: all that `base.voltage` needs, and how sure each number is."""
    return {
        "capacity_ampere_hour": case.cell.capacity_ampere_hour,
        "ocv_soc": np.linspace(0.0, 1.0, len(case.cell.ocv_volt)).tolist(),
        "ocv_volt": np.asarray(case.cell.ocv_volt).tolist(),
        "hold": case.fit.hold,
        "tests": list(case.fit.tests),
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "std": stds(state.solution),
        "effects": [effect.id for effect in state.effects],
    }
