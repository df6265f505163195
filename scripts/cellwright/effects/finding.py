"""The search of one cell: from its tests to a verdict and all that a report shows of it."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.candidates import frees_of
from cellwright.effects.case import Gates, not_excited
from cellwright.effects.given.case import own_case
from cellwright.effects.given.external import external_case, with_simulated
from cellwright.effects.given.judged import as_given, judged_blocks
from cellwright.effects.given.paired import Pairing, paired
from cellwright.effects.judge import joined, residual_map, unsure_by_temperature, worst
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.member import folds
from cellwright.effects.planning.advice import advised
from cellwright.effects.planning.sensitivity import Model, confounding, shown
from cellwright.effects.preparing import STEPS_OF_HOLD, prepared
from cellwright.effects.records import parts_of
from cellwright.effects.score import BANDS
from cellwright.effects.search import free_of, joins, search
from cellwright.effects.stated.nuisances import declared_values_at_limit
from cellwright.effects.story.places import worsened
from cellwright.effects.story.result import Finding
from cellwright.effects.story.sizes import Fitted, sizes_as_used
from cellwright.effects.story.words import paragraph
from cellwright.effects.verdict import CONTRADICTED, outcome, sizes_of_names, verdict_of
from cellwright.effects.witnesses.collected import contradicted, measured_of
from cellwright.numerics.least_squares import covariances, fit, stds
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal

NEEDLESS = "needless beside the others"
KEPT = ("named", "ambiguous")  # verdicts whose effects explain what the plain model lacks


class Reference(NamedTuple):
    """A healthy cell of the type: CellFacts, its basis, a list of MeasuredTest."""

    cell: CellFacts
    basis: dict
    tests: list


def missing_effect(
    cell,
    basis,
    tests,
    library,
    *,
    settings,
    references=(),
    model=None,
    simulated=None,
    others=None,
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
    others : witnesses.collected.Others, measurements that may rule names out; None: there are none.

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
    names = {"split_rest_second": split, "base_name": task.base_name, "others": others}
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


def of_case(name, case, library, *, split_rest_second=None, base_name="plain", others=None):
    """Finding of a case that is prepared already; else as `missing_effect`.

    base_name : "plain", "own" or "external", for the words.
    split_rest_second : shortest rest that ends a block [s]; None: the model is not fitted again
    without blocks, which only a choice between models asks for.
    others : as of `missing_effect`.
    """
    found, result, fitted, ruled_out = uncontradicted(case, library, others)
    known = library
    library = {name: effect for name, effect in library.items() if name not in ruled_out}
    case, rounds, deviations = found.case, found.rounds, fitted.stds
    first, last = found.first, found.last
    residuals = _map(case, first, result.last)
    unexcited = {e.id: not_excited(case, e) for e in library.values()}
    named = {one.effect.id for one in result.names}
    hidden = set.intersection(*(set(step.hidden) for step in rounds)) - named
    hidden |= {name for name, effect in library.items() if effect.invisible}
    untestable = sorted({n for n, why in unexcited.items() if why} | hidden)
    place = worst(residuals, result.floor.validation_volt)
    open_place = None if result.adequate else place
    menu, advice, test = advised(found, result, library, untestable, open_place)
    further = {"next_test": advice, "not_testable": untestable}
    verdict = verdict_of(name, found, result, place, deviations, **further)
    verdict["base"] = base_name
    if base_name != "plain":
        verdict["as_given_rmse_volt"] = as_given(case, rounds[0].filters)
    verdict |= {"next_test_id": test, "worsened": worsened(residuals)}
    # The model holds all that predicts surely better, named or not; whether it is used is for tests
    # left out to decide. What the vocabulary has no word for has no place in a model file.
    kept = [one.effect for one in found.beside if one.effect.id not in OUTSIDE]
    state = first if result.word == "none" else found.with_only(kept)
    declared = state if result.word in KEPT else first
    verdict["nuisances"] = declared_values_at_limit(case, declared, parts_of(case.fit))
    ranking = ranking_of(found, result)
    verdict["against"] = _last_against(ranking, named) | verdict["against"]
    verdict["against"] |= dict.fromkeys(ruled_out, CONTRADICTED)
    verdict["contradicted"] = list(ruled_out.values())
    plain = Model(first.solution.values, first.effects)
    model = model_of(case, state)
    values = about_fit(case) | last.solution.values
    for entry in (*verdict["effects"], *verdict["partial"]):
        sizes = sizes_as_used(library[entry["effect"]], entry["parameters"], values, fitted)
        entry["sizes"] = [size._asdict() for size in sizes]
    verdict["paragraph"] = paragraph(verdict, known)
    if state.effects and split_rest_second is not None:
        rest = {"split_rest_second": split_rest_second}
        model["folds"] = folds(case, state, rounds[-1].noise, **rest)
        if base_name == "own":
            model["blocks"] = judged_blocks(case, state, model["folds"], **rest)
    return Finding(
        verdict,
        ranking,
        residuals,
        _evidence(found, result),
        _series(case, first, result.last, found.filters),
        confounding(shown(case, library, plain, spread=rounds[0].noise)),
        menu,
        model,
        tuple(f"{n} cannot be told: needs {', '.join(w)}" for n, w in unexcited.items() if w),
    )


def searched(case, library):
    """What a search of a cell comes to.

    Parameters
    ----------
    case : case.Case. library : dict of Effect by id.

    Returns
    -------
    found : search.Found. result : verdict.Outcome. fitted : Fitted, of its last model.
    """
    # Rivals first of their stage: the heat of the core is that of the resistances in the end.
    found = search(case, OUTSIDE | library)
    fitted = _fitted(found)
    known = about_fit(found.case) | found.last.solution.values
    return found, outcome(found, fitted, known), fitted


def uncontradicted(case, library, others):
    """As `searched`, and what other measurements rule out: dict id → row of `contradicted`.

    What a measurement of the cell rules out explains nothing: the records are searched once more
    without it, so that neither the model nor the sizes of other effects hold any of it.

    Parameters
    ----------
    case : case.Case. library : dict of Effect by id. others : witnesses.collected.Others, or None.
    """
    ruled_out, left = {}, library
    while True:
        found, result, fitted = searched(case, left)
        if others is None:
            break
        model = model_of(found.case, found.last)
        series = _series(found.case, found.first, found.last, found.filters)
        tables = others.tables | {"series": series}
        measured = measured_of(tables, others.basis, model, ambient=others.ambient)
        names = sizes_of_names(result, fitted.stds)
        more = {one["effect"]: one for one in contradicted(names, model, measured, library)}
        if not more:
            break
        ruled_out |= more
        left = {name: effect for name, effect in left.items() if name not in ruled_out}
    return found, result, fitted, ruled_out


def _otherwise(found):
    """Solution of the last model under the other hold of the current, or None."""
    case, last = found.case, found.last
    if case.otherwise is None or not last.effects:
        return None
    free = free_of(case, found.model)
    problem = case.otherwise.problem(last.effects, free, found.filters)
    return fit(problem, last.solution.values, steps=STEPS_OF_HOLD)


def _fitted(found):
    """How sure the parameters of a model are: by what is left, stated temperatures, and the hold.

    And by what they are in models that are as good to anyone, with one more effect that predicts
    better but too little for a name; they disagree by that (S. Buckland et al., Biometrics 53
    (1997) 603).

    What is left is taken as independent between parts of records, and between whole records: what
    one has of its own (a core warmer than its surface) is in all of its parts. Between the holds of
    the current their likelihood decides, by the scatter that is left: samples at even distances
    tell a resistance and half a sample of a fast pair apart by nothing. What ended on a bound is
    taken as known there; the verdict says so.
    """
    case, last = found.case, found.last
    state = last._replace(solution=last.solution.inside)
    solution, names = state.solution, state.solution.names
    spreads = covariances(solution, parts_of(case.fit))
    if len(case.fit.tests) > 1:
        spreads += covariances(solution, case.fit.file)[1:]
    assumed = unsure_by_temperature(case, state, found.filters.fit)
    if (other := _otherwise(found)) is not None:
        assumed = assumed + _unsure_by_hold(names, solution, other)
    further = [t.state.solution for t in found.rounds[-1].trials if t.gain.total > 0]
    changes = [_change_to(names, solution, one) for one in further]
    assumed = assumed + sum(np.outer(c, c) for c in changes) / max(len(further), 1)
    return Fitted(names, tuple(one + assumed for one in spreads))


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


def ranking_of(found, result):
    """Every candidate that was refitted, round by round, as dict of columns.

    Parameters
    ----------
    found : search.Found. result : verdict.Outcome of it.
    """
    rows = [
        {"round": number}
        | _ranked(trial, step, result)
        | {"against": _against(found, step, trial, result)}
        for number, step in enumerate(found.rounds, 1)
        for trial in step.trials
    ]
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {}


def _against(found, step, trial, result):
    """Why a trial is no name, in words; empty for one that is."""
    chosen = any(trial is one for one in step.joined)
    unnamed = [why for one, why in result.unnamed if one.effect is trial.effect]
    if chosen and any(one.effect is trial.effect for one in result.names):
        return ""
    if chosen and unnamed:
        return unnamed[0]
    if chosen or trial.effect.key in step.dropped:
        return NEEDLESS
    if trial.effect.key in step.denied:
        return "a measurement contradicts it"
    if not joins(trial.gain, found.case.gates):
        return "it does not predict surely better"
    return "another explains more" if step.joined else "nothing is left that anyone would act on"


def _last_against(ranking, named):
    """What spoke last against each effect that was tried and is no name: dict id → words."""
    pairs = zip(ranking.get("effect", ()), ranking.get("against", ()), strict=True)
    return {effect: words for effect, words in pairs if effect not in named and words}


def _ranked(trial, step, result):
    effect, solution = trial.effect, trial.state.solution
    names = [free.name for free in frees_of(effect)]
    row = {"effect": effect.id}
    if effect.position is not None:
        row |= {"branch": effect.position + 1, "value": solution.values[effect.names[0]]}
    tied = {
        key
        for one in result.names
        if any(one.effect is joined.effect for joined in step.joined)
        for key in one.tied
    }
    return row | {
        "parameters_counted": len(names),
        "score_chi_square": trial.score,
        "gain": trial.gain.total,
        "z": trial.gain.z,
        "rank_z": trial.gain.rank_z,
        "rmse_volt": trial.state.rmse_volt,
        "validation_rmse_volt": trial.state.validation_rmse_volt,
        "in_range": not set(names) & set(solution.at_bound),
        "chosen": any(trial is one for one in step.joined),
        "tied": effect.key in tied,
    }


def _evidence(found, result):
    """Of each name: what it changes of each block, and what was missing there without it."""
    blocks, parts = found.filters.blocks, []
    for one in result.names:
        ends = one.before, one.trial.state
        for role, stack, block, residuals in (
            ("fit", found.case.fit, blocks.fitted, [s.solution.residual for s in ends]),
            ("validation", found.case.validation, blocks.judging, [s.validation for s in ends]),
        ):
            columns = _evidence_of(stack, block, blocks.band, residuals)
            about = {"effect": one.effect.id, "role": role}
            rows = len(columns["rows"])
            parts.append({name: [value] * rows for name, value in about.items()} | columns)
    return joined(parts)


def _evidence_of(stack, block, band, residuals):
    """Columns of the evidence of one effect on one side, a row a block; see `score.Blocks`."""
    inside = block >= 0
    number, first, row = np.unique(block[inside], return_index=True, return_inverse=True)
    before, change = residuals[0][inside], (residuals[0] - residuals[1])[inside]
    rows = np.bincount(row)
    size = np.sqrt(np.bincount(row, change**2) / rows)
    missing = np.bincount(row, before * change) / rows / np.maximum(size, 1e-12)
    return {
        "test": [stack.tests[k] for k in stack.file[inside][first]],
        "soc_low": (band[number] / BANDS).tolist(),
        "soc_high": ((band[number] + 1) / BANDS).tolist(),
        "rows": rows.tolist(),
        "sensitivity_volt": size.tolist(),
        "residual_volt": missing.tolist(),
    }


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


def about_fit(case):
    """Capacity [Ah], lowest and highest mean temperature of the records fitted [degC]: dict.

    Also, where the dates are known, the time between the first and the last test [d].
    """
    stack = case.fit
    means = np.bincount(stack.file, stack.celsius) / np.bincount(stack.file)
    known = {
        "fitted_celsius": [float(means.min()), float(means.max())],
        "capacity_ampere_hour": case.cell.capacity_ampere_hour,
    }
    return known if stack.age is None else known | {"aged_day": stack.aged_day}


def model_of(case, state):
    """A fitted model with its effects: all that `base.voltage` needs, with standard deviations.

    Also `about_fit`. start_soc : SoC at the start of each of the records fitted.
    """
    stack = case.fit
    return about_fit(case) | {
        "ocv_soc": np.linspace(0.0, 1.0, len(case.cell.ocv_volt)).tolist(),
        "ocv_volt": np.asarray(case.cell.ocv_volt).tolist(),
        "hold": case.fit.hold,
        "tests": list(case.fit.tests),
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "std": stds(state.solution, parts_of(case.fit)),
        "start_soc": base.starts_of(case.cell, stack, state.solution.values, state.effects),
        "effects": [effect.id for effect in state.effects],
    }
