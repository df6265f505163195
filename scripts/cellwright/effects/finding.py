"""The search of one cell: from its tests to a verdict and all that a report shows of it."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.candidates import frees_of
from cellwright.effects.case import Gates, not_excited
from cellwright.effects.ceiling import ceiling
from cellwright.effects.given.case import own_case
from cellwright.effects.given.external import external_case, with_simulated
from cellwright.effects.given.judged import as_given, judged_blocks
from cellwright.effects.given.paired import Pairing, paired
from cellwright.effects.judge import (
    BANDS,
    joined,
    residual_map,
    unsure_by_temperature,
    worst,
)
from cellwright.effects.member import folds
from cellwright.effects.odds import SURE, probability_of
from cellwright.effects.planning.advice import advised
from cellwright.effects.planning.sensitivity import Model, confounding, shown
from cellwright.effects.preparing import prepared
from cellwright.effects.proof import explained, prominent
from cellwright.effects.records import parts_of
from cellwright.effects.search import against
from cellwright.effects.stated.nuisances import declared_values_at_limit
from cellwright.effects.story.places import worsened
from cellwright.effects.story.result import Finding
from cellwright.effects.story.sizes import Fitted, sizes_as_used
from cellwright.effects.story.words import paragraph
from cellwright.effects.verdict import entry_of, searched, verdict_of
from cellwright.effects.witnesses.collected import values_of
from cellwright.numerics.least_squares import covariances, stds
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal

NEEDLESS = "needless beside the others"
SMALL_PART = "it takes off less than half as much as is left beside it"
SMALL = "in the model, too small for a name"
NOT_SURE = f"in the model; beside a likelier name it has to be {100 * SURE:.0f} % likely"
KEPT = ("named", "ambiguous")  # verdicts whose effects go into the model


class Reference(NamedTuple):
    """A healthy cell of the type: CellFacts, its basis, a list of MeasuredTest."""

    cell: CellFacts
    basis: dict
    tests: list


def missing_effect(
    cell, basis, tests, library, *, settings, references=(), model=None, simulated=None
):
    """Verdict on a cell: which effect a model of it lacks, with ranking, residuals and next test.

    The model is the plain circuit (base `plain`); or one that is given: the chosen member of the
    cell's model (`own`), or a voltage simulated by any other (`external`).

    Parameters
    ----------
    cell : CellFacts. basis : dict, from `basis.basis`.
    tests : list of MeasuredTest. library : dict of Effect by id.
    settings : dict: those of `settings_of`, and split_rest_second.
    model : dict of schema cellwright-model/2, for the base `own`. simulated : dict test →
    external.Simulated, for the base `external`; tests without one take no part.
    references : sequence of Reference, of the base `plain`. Where one or more ran the same
    protocol, and the plain model fails them by far more than noise, the cell is compared with them
    (paired mode).

    Returns
    -------
    finding : Finding.

    Raises
    ------
    Refusal : no OCV, nothing to fit, or nothing that judges; no simulated voltage that can be
    joined to its test.
    """
    bases = {"references": references, "model": model, "simulated": simulated}
    task = task_of(cell, basis, tests, settings=settings, **bases)
    # A plain or own model is one to choose: it is fitted again without blocks. External is none.
    split = None if task.base_name == "external" else settings["split_rest_second"]
    names = {"split_rest_second": split, "base_name": task.base_name}
    finding = of_case(cell.cell, task.case, library, **names)
    text = "\n".join([finding.verdict["paragraph"], *task.caveats])
    verdict = finding.verdict | {"references": list(task.references), "paragraph": text}
    known = {} if task.given is None else {"given": task.given}
    notes = (*task.notes, *finding.notes)
    return finding._replace(verdict=verdict, model=finding.model | known, notes=notes)


class Task(NamedTuple):
    """What a search is asked: its case, and what the model is.

    case : case.Case. base_name : "plain", "own" or "external". references : names of the healthy
    cells that the cell is compared with. notes, caveats : tuples of str, see `preparing.Prepared`.
    """

    case: object
    base_name: str
    references: tuple
    notes: tuple
    caveats: tuple
    given: dict | None = None


def task_of(cell, basis, tests, *, settings, references=(), model=None, simulated=None):
    """Case of a search before anything is searched: Task; arguments as of `missing_effect`."""
    gates, tolerance = settings_of(settings)
    options = {"tolerance": tolerance, "gates": gates, "settings": settings}
    base_name, used, note, given = "plain", [], (), None
    if simulated is not None:
        tests, note = with_simulated(tests, simulated)
    ready = _ready(cell, basis, tests, options, note)
    if model is not None:
        base_name, (case, given) = "own", own_case(ready, model)
    elif simulated is not None:
        base_name, case = "external", external_case(ready)
    else:
        case, used, note = _paired(ready.case, references, options)
    return Task(case, base_name, tuple(used), (*ready.notes, *note), ready.caveats, given)


def _ready(cell, basis, tests, options, notes):
    """As `preparing.prepared`; a refusal tells as well which simulation could not be joined."""
    try:
        return prepared(cell, basis, tests, **options)
    except Refusal as refusal:
        raise Refusal("; ".join([str(refusal), *notes])) from None


def _paired(case, references, options):
    """The case in paired mode where that serves: (case, names of the references, notes)."""
    if not references:
        return case, [], ()
    try:
        others = {r.cell.cell: prepared(*r, **options).case for r in references}
        pair = paired(case, others)
    except Refusal as refusal:
        return case, [], (f"searched alone, not beside the references: {refusal}",)
    if not pair.needed:
        return case, [], ("searched alone: the plain model follows the references to the noise",)
    names = ", ".join(pair.references)
    notes = [f"searched beside the references {names}"]
    notes += [f"not compared with {name}: {why}" for name, why in pair.unshared.items()]
    few = Pairing()
    if len(pair.references) < few.known_from:
        notes.append(
            f"how much healthy cells differ cannot be read from {len(pair.references)} of them: "
            f"{1e3 * few.material_volt_of_few:g} mV, and {100 * few.scale_std_of_few:g} % of what "
            "the references show, were taken"
        )
    return pair.case, list(pair.references), tuple(notes)


def settings_of(settings):
    """Gates and tolerances from the settings of a campaign, by their names."""
    gates = Gates(**{name: settings[name] for name in Gates._fields if name in settings})
    tolerances = {
        name: settings[f"{name}_tolerance"]
        for name in base.Tolerance._fields
        if f"{name}_tolerance" in settings
    }
    return gates, base.Tolerance(**tolerances)


def of_case(name, case, library, *, split_rest_second=None, base_name="plain"):
    """Finding of a case that is prepared already; else as `missing_effect`.

    base_name : "plain", "own" or "external", for the words.
    split_rest_second : shortest rest that ends a block [s]; None: the model is not fitted again
    without blocks, which only a choice between models asks for.
    """
    case, rounds, result, shares_of_answers, holds, alone, outside = searched(case, library)
    residuals = _map(case, rounds[0].before, result.last)
    unexcited = {e.id: not_excited(case, e) for e in library.values()}
    named = {step.chosen.effect.id for step in result.steps}
    hidden = set.intersection(*(set(step.hidden) for step in rounds)) - named
    hidden |= {name for name, effect in library.items() if effect.invisible}
    untestable = sorted({n for n, why in unexcited.items() if why} | hidden)
    place = worst(residuals, result.floor.validation_volt)
    open_place = None if result.adequate else place
    menu, advice, test = advised(case, result, rounds, library, untestable, open_place, outside)
    verdict = verdict_of(
        *(name, result, rounds, place),
        next_test=advice,
        not_testable=untestable,
        entry=lambda *of: entry_of(*of, parts_of(case.fit)),
    )
    verdict["base"] = base_name
    if base_name != "plain":
        verdict["as_given_rmse_volt"] = as_given(case, rounds[0].filters)
    for entry in (*verdict["effects"], *verdict["partial"]):
        names = entry["effect"], *entry["alternatives"]
        entry["probability"] = probability_of(shares_of_answers, names)
    verdict["remainder"] |= _learnable(case, result, rounds[-1].filters)
    verdict |= {"next_test_id": test, "probabilities": shares_of_answers}
    verdict["worsened"] = worsened(residuals)
    verdict["outside"] = [_outside(trial, result.last, parts_of(case.fit)) for trial in outside]
    kept = bool(result.steps) and result.word in KEPT
    state = result.last if kept else rounds[0].before
    verdict["nuisances"] = declared_values_at_limit(case, state, parts_of(case.fit))
    ranking = ranking_of(case, rounds, result)
    nameless = dict.fromkeys(verdict["small"], SMALL)
    nameless |= {step.unsure.effect.key: NOT_SURE for step in rounds if step.unsure}
    verdict["against"] = _last_against(ranking, named) | nameless
    plain = Model(rounds[0].before.solution.values, rounds[0].before.effects)
    model = model_of(case, state)
    values = values_of(model) | result.last.solution.values
    further = [t.state.solution for t in rounds[-1].trials if t.delta_bic > 0]
    fitted = _fitted(case, result.last, rounds[-1].filters.fit, holds, alone, further)
    for entry in (*verdict["effects"], *verdict["partial"]):
        effect = library[entry["effect"]]
        entry["parameters"] = _as_sure(effect, entry["parameters"], fitted)
        sizes = sizes_as_used(effect, entry["parameters"], values, fitted)
        entry["sizes"] = [size._asdict() for size in sizes]
    verdict["paragraph"] = paragraph(verdict, library)
    if kept and split_rest_second is not None:
        rest = {"split_rest_second": split_rest_second}
        model["folds"] = folds(case, result.last, rounds[-1].noise, **rest)
        if base_name == "own":
            model["blocks"] = judged_blocks(case, result.last, model["folds"], **rest)
    return Finding(
        verdict,
        ranking,
        residuals,
        _evidence(case, result),
        _series(case, rounds[0].before, result.last, rounds[-1].filters),
        confounding(shown(case, library, plain, spread=rounds[0].noise)),
        menu,
        model,
        tuple(f"{n} cannot be told: needs {', '.join(w)}" for n, w in unexcited.items() if w),
    )


def _learnable(case, result, filters):
    """What any function of SoC, temperature and past current would leave of the last model."""
    best = ceiling(case, result.last, filters, result.floor)
    return {
        "ceiling_volt": best.validation_volt,
        "ceiling_fit_volt": best.fit_volt,
        "learnable": best.learnable,
    }


def _outside(trial, before, parts):
    """What the vocabulary has no name for: its size, and errors of a State without and with it."""
    (p, *_), (name, *_) = trial.effect.parameters, trial.effect.names
    ends = before, trial.state
    errors = {
        side: dict(zip(("before", "after"), (getattr(s, side) for s in ends), strict=True))
        for side in ("rmse_volt", "validation_rmse_volt")
    }
    solution = trial.state.solution
    size = {"value": float(solution.values[name]), "std": stds(solution, parts)[name]}
    return {"effect": trial.effect.id, "parameter": p.name, "unit": p.unit} | size | errors


def _fitted(case, state, whitening, holds, alone, further):
    """How sure the parameters of a model are: by what is left, stated temperatures, and the hold.

    And by what they are in models that are as good to anyone: without an effect that nobody would
    act on (`alone`, a Solution or None), and with one more that follows the records fitted better
    but is no name (`further`, list of Solution); they disagree by that (S. Buckland et al.,
    Biometrics 53 (1997) 603).

    What is left is taken as independent between parts of records, and between whole records: what
    one has of its own (a core warmer than its surface) is in all of its parts. Between the holds of
    the current their likelihood decides, by the scatter that is left: samples at even distances
    tell a resistance and half a sample of a fast pair apart by nothing. What ended on a bound is
    taken as known there; the verdict says so.
    """
    state = state._replace(solution=state.solution.inside)
    by_temperature = unsure_by_temperature(case, state, whitening)
    spreads = covariances(state.solution, parts_of(case.fit))
    if len(case.fit.tests) > 1:
        spreads += covariances(state.solution, case.fit.file)[1:]
    names = state.solution.names
    assumed = by_temperature + _unsure_by_hold(names, *holds) if holds else by_temperature
    for others in ([] if alone is None else [alone], further):
        changes = [_change_to(names, state.solution, other) for other in others]
        assumed = assumed + sum(np.outer(c, c) for c in changes) / max(len(others), 1)
    return Fitted(names, tuple(one + assumed for one in spreads))


def _as_sure(effect, parameters, fitted):
    """Parameters of an effect in a verdict, as sure as the sizes that follow from them."""
    stds = np.sqrt(np.max([np.diag(one) for one in fitted.covariances], axis=0))
    by_name = dict(zip(fitted.names, stds.tolist(), strict=True))
    names = {one.name: name for one, name in zip(effect.parameters, effect.names, strict=True)}
    return {
        name: one | ({} if one["std"] is None else {"std": by_name.get(names[name], one["std"])})
        for name, one in parameters.items()
    }


def _change_to(names, solution, other):
    """Change (p,) of parameters to another solution; zero of those that it has not."""
    shared = set(other.names)
    return np.array([other.values[n] - solution.values[n] if n in shared else 0.0 for n in names])


def _unsure_by_hold(names, here, there):
    """Covariance (p, p) of parameters for all that decides between two solutions."""
    scatter = max(here.chi_square / len(here.residual), 1.0)
    odds = np.exp(min((here.cost - there.cost) / (2 * scatter), 0.0))
    change = np.array([there.values[name] - here.values[name] for name in names])
    return odds / (1 + odds) * np.outer(change, change)


def _map(case, before, after):
    """Residual map of both roles, before and after the effects."""
    return joined(
        [
            _map_of(case, case.fit, "fit", before, after),
            _map_of(case, case.validation, "validation", before, after),
        ]
    )


def _map_of(case, stack, role, before, after):
    values = [s.solution.values if role == "fit" else s.values for s in (before, after)]
    fields = base.fields_of(case.cell, stack, values[1], after.effects)
    residuals = [s.solution.residual if role == "fit" else s.validation for s in (before, after)]
    capacity = case.cell.capacity_ampere_hour
    return residual_map(stack, role, fields.soc, *residuals, capacity, stack.used)


def ranking_of(case, rounds, result=None):
    """Every candidate that was refitted, round by round, as dict of columns.

    Parameters
    ----------
    case : of a cell or group. rounds : list of search.Round. result : verdict.Outcome of them,
        where names may be refused at the end.
    """
    rows = [
        {"round": number}
        | _ranked(trial, step)
        | {"against": _against(case, rounds[0], step, trial, result)}
        for number, step in enumerate(rounds, 1)
        for trial in step.trials
    ]
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {}


def _against(case, first, step, trial, result):
    """Why a trial is no choice of its round, in words; empty for the choice that stays."""
    if trial is step.chosen and trial.effect.key not in step.dropped:
        return ""
    if trial is step.unsure:
        return NOT_SURE
    if explained(case.gates, step.before, first.floor):
        return "nothing is left that anyone would act on"
    words = list(against(case, first.before, step.before, trial, first.floor))
    if trial.effect.key in case.denied(step.trials):
        words.append("a measurement contradicts it")
    if trial.at_limit:
        words.append("its size is at the limit of what it can be")
    if trial.effect.key in step.dropped:
        last = result is not None and result.refused is not None and trial is result.refused.chosen
        shown = prominent(step.before, trial, first.floor)
        words.append(result.why_refused if last else NEEDLESS if shown else SMALL_PART)
    return "; ".join(words) or "another explains more"


def _last_against(ranking, named):
    """What spoke last against each effect that was tried and is no name: dict id → words."""
    pairs = zip(ranking.get("effect", ()), ranking.get("against", ()), strict=True)
    return {effect: words for effect, words in pairs if effect not in named and words}


def _ranked(trial, step):
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
        "chosen": trial is step.chosen,
        "tied": effect.key in step.tied,
    }


def _evidence(case, result):
    """Of each effect chosen: what it changes of each block that judged it, and what was missing."""
    parts = []
    for step in result.steps:
        chosen = step.chosen
        role, stack = ("validation", case.validation) if chosen.proven else ("fit", case.fit)
        sums = case.changed(step.before, chosen.state, step.filters)[role]
        change = np.sqrt(sums.energy[sums.kept])
        band = sums.block[sums.kept] % BANDS
        parts.append(
            {
                "effect": [chosen.effect.id] * len(change),
                "role": [role] * len(change),
                "test": [stack.tests[k] for k in sums.file[sums.kept]],
                "soc_low": (band / BANDS).tolist(),
                "soc_high": ((band + 1) / BANDS).tolist(),
                "rows": sums.rows[sums.kept].tolist(),
                "sensitivity_volt": change.tolist(),
                "residual_volt": (sums.shared[sums.kept] / change).tolist(),
            }
        )
    return joined(parts)


def _series(case, before, after, filters):
    """Columns of all records: what was measured, both models, and which rows the errors count."""
    parts, counted = [], {"fit": filters.fit_rows, "validation": filters.validation_rows}
    for role, stack in (("fit", case.fit), ("validation", case.validation)):
        values = after.solution.values if role == "fit" else after.values
        fields = base.fields_of(case.cell, stack, values, after.effects)
        residuals = [
            s.solution.residual if role == "fit" else s.validation for s in (before, after)
        ]
        parts.append(
            {
                "role": [role] * len(stack.file),
                "test": [stack.tests[k] for k in stack.file],
                "test_time_second": stack.second.tolist(),
                "current_ampere": stack.current_ampere.tolist(),
                "celsius": stack.celsius.tolist(),
                "soc": fields.soc.tolist(),
                "used": stack.used.tolist(),
                "counted": counted[role].tolist(),
                "voltage_volt": stack.voltage_volt.tolist(),
                "before_volt": (stack.voltage_volt - residuals[0]).tolist(),
                "after_volt": (stack.voltage_volt - residuals[1]).tolist(),
            }
        )
    return joined(parts)


def model_of(case, state):
    """A fitted model with its effects: all that `base.voltage` needs, with standard deviations.

    fitted_celsius : lowest and highest mean temperature of the records fitted. start_soc : SoC at
    the start of each of them.
    """
    stack = case.fit
    means = np.bincount(stack.file, stack.celsius) / np.bincount(stack.file)
    return {
        "fitted_celsius": [float(means.min()), float(means.max())],
        "capacity_ampere_hour": case.cell.capacity_ampere_hour,
        "ocv_soc": np.linspace(0.0, 1.0, len(case.cell.ocv_volt)).tolist(),
        "ocv_volt": np.asarray(case.cell.ocv_volt).tolist(),
        "hold": case.fit.hold,
        "tests": list(case.fit.tests),
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "std": stds(state.solution, parts_of(case.fit)),
        "start_soc": base.starts_of(case.cell, stack, state.solution.values, state.effects),
        "effects": [effect.id for effect in state.effects],
    }
