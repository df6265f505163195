"""The search of one cell: from its tests to a verdict and all that a report shows of it."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import in_use
from cellwright.effects import base
from cellwright.effects.advice import advised
from cellwright.effects.case import Gates, not_excited
from cellwright.effects.columns import frees_of
from cellwright.effects.given import paired
from cellwright.effects.given.case import as_given, own_case
from cellwright.effects.given.external import Simulated, external_case, with_simulated
from cellwright.effects.judge import joined, residual_map, unsure_by_temperature, worst
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.member import folds, shift_of_starts
from cellwright.effects.preparing import KINDS, SLOW_TEST, STEPS_OF_HOLD, prepared
from cellwright.effects.records import parts_of
from cellwright.effects.score import BANDS
from cellwright.effects.search import joins, resume_without, search
from cellwright.effects.state import SIDES
from cellwright.effects.stated.nuisances import declared_values_at_limit
from cellwright.effects.story.messages import say
from cellwright.effects.story.places import worsened
from cellwright.effects.story.result import Finding
from cellwright.effects.story.sizes import Fitted, sizes_as_used
from cellwright.effects.story.words import name_of_effect, next_test, paragraph
from cellwright.effects.verdict import CONTRADICTED, outcome, sizes_of_names, verdict_of
from cellwright.effects.witnesses.collected import Others, contradicted, measured_of
from cellwright.messages import said_of
from cellwright.numerics.least_squares import covariances, fit, stds
from cellwright.records import inputs
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal
from cellwright.settings import MissingEffect, Models

MODELS = Models()
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
    settings=None,
    *,
    references=(),
    model=None,
    simulated=None,
    library=None,
    measurements=None,
    ambient_celsius=None,
    split_rest_second=MODELS.split_rest_second,
    **changes,
):
    """Effects that a model of a cell lacks, proved on tests that were not fitted.

    Of the plain circuit; of a model of the cell (`model`); or of any other (`simulated`).

    tests : of roles fit, split and validation. settings : `settings.MissingEffect`.
    references : (cell, basis, tests) of healthy cells of the type; from three on, the cell is
        compared with them.
    model : result of `finish_model`, or path of its file: what does the model in use still lack?
    simulated : dict test → (time (n,) [s], voltage (n,) [V]) by any simulator, on the test's own
        clock, or the result of `read_simulated`: what does that one lack? Tests without a simulated
        voltage take no part; one whose simulation does not fit is left out with a note.
    library : effects by id that are tried, None: all of `effects.library.LIBRARY`.
    measurements, ambient_celsius : other measurements of the cell, as `tables` and
        `ambient_celsius` of `witnesses` without `series`: an effect that one of them contradicts is
        not named. None: there are none.

    Returns ranking, residual_map, evidence, series; content: model, and verdict, the document of
    docs/missing-effect.md. Raises Refusal: no OCV, no test to fit, or none for validation.
    Source: docs/missing-effect.md.
    """
    library = LIBRARY if library is None else library
    options = options_of(settings, split_rest_second, changes)
    cell, basis, tests = _record_of(cell, basis, tests)
    model = None if model is None else given.model(model)
    others = None
    if measurements is not None:
        rows = {name: inputs.rows(table) for name, table in measurements.items()}
        others = Others(rows, basis, ambient_celsius or {})
    base_name, used, note = "plain", (), ()
    if simulated is not None:
        simulated = {test: Simulated(*one) for test, one in simulated.items()}
        tests, note = with_simulated(tests, simulated)
    try:
        ready = prepared(cell, basis, tests, **options)
    except Refusal as refusal:
        raise Refusal("; ".join([str(refusal), *note])) from None
    if model is not None:
        base_name, case = "own", own_case(ready, model)
    elif simulated is not None:
        base_name, case = "external", external_case(ready)
    else:
        # Healthy cells of the type go the same way as the cell itself, so that errors of method
        # cancel.
        healthy = [Reference(*_record_of(*reference)) for reference in references]
        case, used, note = _paired(ready.case, healthy, options)
    # A plain model with its effects is one to choose: it is fitted again without blocks.
    split = split_rest_second if base_name == "plain" else None
    names = {"split_rest_second": split, "base_name": base_name, "others": others}
    finding = of_case(cell.cell, case, library, **names)
    text = "\n".join([finding.verdict["paragraph"], *ready.caveats])
    verdict = finding.verdict | {"references": list(used), "paragraph": text}
    if model is not None:
        particle = model.get("particle") or {}
        about = {name: particle.get(name) for name in ("left_out_rmse_volt", "parts")}
        verdict["in_use"] = {"model": in_use(model)} | about
    notes = (*ready.notes, *note, *finding.notes)
    return finding._replace(verdict=verdict, notes=notes).result()


def _record_of(cell, basis, tests):
    return inputs.cell_facts(cell), inputs.basis(basis), inputs.tests(tests)


def options_of(settings, split_rest_second, changes):
    """What `prepared` takes beside the tests: tolerance, gates by their names in the settings, and
    settings."""
    search = inputs.settings_of(MissingEffect, settings, changes)._asdict()
    gates = Gates(**{name: search[name] for name in Gates._fields if name in search})
    search |= {"split_rest_second": split_rest_second}
    return {"tolerance": base.Tolerance(), "gates": gates, "settings": search}


def prepared_case(
    cell, basis, tests, settings=None, *, split_rest_second=MODELS.split_rest_second, **changes
):
    """The records and the plain model of a cell, as the search for missing effects takes them.

    tests : those of other kinds than are searched are skipped. settings : `settings.MissingEffect`.

    Returns `effects.case.Case`. Raises Refusal: no OCV, no test to fit, or none for validation.
    Source: docs/missing-effect.md.
    """
    options = options_of(settings, split_rest_second, changes)
    # Read before the kinds are chosen: impedance spectra have no columns of a series.
    known = [(inputs.test_facts(facts), series) for facts, series in tests]
    mine = [one for one in known if one[0].kind in (SLOW_TEST, *KINDS)]
    return prepared(*_record_of(cell, basis, mine), **options).case


def _paired(case, references, options):
    """The case in paired mode where that serves: (case, names of the references, notes)."""
    if not references:
        return case, [], ()
    try:
        others = {r.cell.cell: prepared(*r, **options).case for r in references}
        pair = paired.paired(case, others)
    except Refusal as refusal:
        return case, [], (f"searched alone, not beside the references: {refusal}",)
    if not pair.needed:
        return case, [], ("searched alone: the plain model follows the references to the noise",)
    names = ", ".join(pair.references)
    notes = [f"searched beside the references {names}"]
    notes += [f"not compared with {name}: {why}" for name, why in pair.unshared.items()]
    if len(pair.references) < paired.KNOWN_FROM:
        notes.append(
            f"how much healthy cells differ cannot be read from {len(pair.references)} of them: "
            f"{1e3 * paired.MATERIAL_VOLT_OF_FEW:g} mV, and "
            f"{100 * paired.SCALE_STD_OF_FEW:g} % of what "
            "the references show, were taken"
        )
    return pair.case, list(pair.references), tuple(notes)


def of_case(name, case, library, *, split_rest_second=None, base_name="plain", others=None):
    """Finding of a case that is prepared already; else as `missing_effect`.

    base_name : "plain", "own" or "external", for the words.
    split_rest_second : shortest rest that ends a block [s]; None: the model is not fitted again
    without blocks, which only a choice between models asks for.
    others : as of `missing_effect`.
    """
    found, result, fitted, ruled_out = searched(case, library, others)
    known = library
    library = {name: effect for name, effect in library.items() if name not in ruled_out}
    case, deviations = found.case, fitted.stds
    first, last = found.first, found.last
    socs = _socs(case, result.last)
    residuals = _map(case, socs, first, result.last)
    unexcited = {e.id: not_excited(case, e) for e in library.values()}
    named = {one.effect.id for one in result.names}
    hidden = set(found.hidden) - named | {
        name for name, effect in library.items() if effect.invisible
    }
    hidden &= library.keys()
    untestable = sorted({n for n, why in unexcited.items() if why} | hidden)
    place = worst(residuals, result.floor.validation_volt)
    open_place = None if result.adequate else place
    question = advised(found, result, library, untestable, open_place)
    further = {"next_test": next_test(question, library), "not_testable": untestable}
    verdict = verdict_of(name, found, result, place, deviations, **further)
    verdict["base"] = base_name
    if base_name != "plain":
        given = as_given(case, found.filters)
        verdict["as_given_rmse_volt"] = given
        verdict["errors"]["member"] = {f"{side}_volt": volt for side, volt in given.items()}
    verdict |= {"next_question": question, "worsened": worsened(residuals)}
    # The model holds all that predicts surely better, named or not; whether it is used is for tests
    # left out to decide. What the vocabulary has no word for has no place in a model file.
    kept = [one.effect for one in found.beside if one.effect.id not in OUTSIDE]
    whole = found.with_only(kept)
    state = first if result.word == "none" else whole
    declared = state if result.word in KEPT else first
    verdict["nuisances"] = declared_values_at_limit(case, declared, parts_of(case.fit))
    ranking = ranking_of(found, result)
    # What spoke last against each effect that was tried and is no name.
    spoke = zip(ranking.get("effect", ()), ranking.get("code", ()), strict=True)
    against = {effect: code for effect, code in spoke if effect not in named and code}
    verdict["against"] = against | verdict["against"]
    verdict["against"] |= dict.fromkeys(ruled_out, CONTRADICTED)
    verdict["contradicted"] = list(ruled_out.values())
    model = model_of(case, state)
    if whole.effects and whole is not state:
        model["joined"] = {name: float(value) for name, value in whole.solution.values.items()}
    values = about_fit(case) | last.solution.values
    for entry in (*verdict["effects"], *verdict["partial"]):
        sizes = sizes_as_used(library[entry["effect"]], entry["parameters"], values, fitted)
        entry["sizes"] = [size._asdict() for size in sizes]
    verdict["paragraph"] = paragraph(verdict, known)
    if state.effects and split_rest_second is not None:
        noise = found.filters.noise
        model["folds"] = folds(case, state, noise, split_rest_second=split_rest_second)
    return Finding(
        verdict,
        ranking,
        residuals,
        _evidence(found, result),
        _series(case, socs, first, result.last, found.filters),
        model,
        tuple(
            said_of(f"{name_of_effect(name, library)} untested", f"it needs {', '.join(wanted)}")
            for name, wanted in unexcited.items()
            if wanted
        ),
    )


def searched(case, library, others=None):
    """What a search of a cell comes to, without what other measurements of the cell rule out.

    That explains nothing: the search goes on without it, so that neither the model nor the sizes of
    other effects hold any of it.

    Parameters
    ----------
    case : case.Case. library : dict of Effect by id. others : witnesses.collected.Others, or None.

    Returns
    -------
    found : search.Search. result : verdict.Outcome. fitted : Fitted, of its last model. ruled_out :
    dict id → row of `contradicted`.
    """
    # Rivals first of their stage: the heat of the core is that of the resistances in the end.
    found, ruled_out = search(case, OUTSIDE | library), {}
    while True:
        fitted = _fitted(found)
        result = outcome(found, fitted, about_fit(case) | found.last.solution.values)
        more = {} if others is None else _ruled_out(found, result, fitted, others, library)
        if not more:
            return found, result, fitted, ruled_out
        ruled_out |= more
        found = resume_without(found, ruled_out)


def _ruled_out(found, result, fitted, others, library):
    """Names that other measurements rule out, see `searched`: dict id → row of `contradicted`."""
    model, socs = model_of(found.case, found.last), _socs(found.case, found.last)
    series = _series(found.case, socs, found.first, found.last, found.filters)
    tables = others.tables | {"series": series}
    measured = measured_of(tables, others.basis, model, ambient=others.ambient)
    names = sizes_of_names(result, fitted.stds)
    return {one["effect"]: one for one in contradicted(names, model, measured, library)}


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
    if case.otherwise is not None and last.effects:
        problem = case.otherwise.problem(last.effects, found.model.free, found.filters)
        other = fit(problem, last.solution.values, steps=STEPS_OF_HOLD)
        scatter = max(solution.chi_square / len(solution.residual), 1.0)
        odds = np.exp(min((solution.cost - other.cost) / (2 * scatter), 0.0))
        change = np.array([other.values[name] - solution.values[name] for name in names])
        assumed = assumed + odds / (1 + odds) * np.outer(change, change)
    changes = found.spaces[-1].changes_by_another(last.solution.names)
    changes = [np.array([change[name] for name in names]) for change in changes]
    assumed = assumed + sum(np.outer(c, c) for c in changes) / max(len(changes), 1)
    return Fitted(names, tuple(one + assumed for one in spreads))


def _map(case, socs, *ends):
    """Residual map of both sides, before and after the effects."""
    capacity = case.cell.capacity_ampere_hour
    parts = [(side, case.stack(side), [one.residual_on(side) for one in ends]) for side in SIDES]
    return joined(
        residual_map(stack, side, socs[side], *residuals, capacity, stack.used)
        for side, stack, residuals in parts
    )


def _socs(case, state):
    """SoC of every row by a model (n,) [1], by side."""
    about = case.cell, state.effects
    return {
        side: base.fields_of(about[0], case.stack(side), state.values_on(side), about[1]).soc
        for side in SIDES
    }


def ranking_of(found, result):
    """What every effect would gain: first beside the plain model, then beside all of the last one.

    The gain of an effect that is in a model is that over an exact fit without it; of the others
    that by the space about the model.

    Parameters
    ----------
    found : search.Search. result : verdict.Outcome of it.

    Returns
    -------
    columns : dict of lists, a row an effect and round.
    """
    rows = [_ranked(found, result, 1, *one) for one in found.spaces[0].gains()]
    if found.beside:
        rows += [_ranked(found, result, 2, *one) for one in found.spaces[-1].gains()]
        rows += [_inside(found, result, one) for one in found.beside]
    rows.sort(key=lambda row: (row["round"], -row["gain"]))
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {}


def _inside(found, result, one):
    """Row of an effect that is in the last model; no first step towards it is asked."""
    sizes = one.effect.sizes_of(one.state.solution.values)
    in_range = not set(one.effect.names) & set(one.state.solution.at_bound)
    about = one.gain, next(iter(sizes.values())), in_range, None
    errors = {name: getattr(one.state, name) for name in ("rmse_volt", "validation_rmse_volt")}
    return _ranked(found, result, 2, one.effect, *about) | errors


def _ranked(found, result, number, effect, gain, size, in_range, chi_square):
    """Row of an effect beside a model. size : its leading one [unit of its parameter]."""
    inside = {one.effect.key for one in found.beside}
    fitted = found.models.get((effect.key,)) if number == 1 else None
    row = {"round": number, "effect": effect.id}
    if effect.position is not None:
        row |= {"branch": effect.position + 1, "value": size}
    return row | {
        "parameters_counted": len(frees_of(effect)),
        "score_chi_square": chi_square,
        "gain": gain.total,
        "z": gain.z,
        "rank_z": gain.rank_z,
        "rmse_volt": fitted.state.rmse_volt if fitted else None,
        "validation_rmse_volt": fitted.state.validation_rmse_volt if fitted else None,
        "in_range": in_range,
        "chosen": effect.key in inside,
        "tied": any(effect.key in one.tied for one in result.names),
        "code": (code := _against(found, result, effect, gain)),
        "against": code and say(f"against.{code}"),
    }


def _against(found, result, effect, gain):
    """Why an effect is no name, as a code; empty for one that is."""
    if any(one.effect.key == effect.key for one in result.names):
        return ""
    unnamed = {one.effect.key: why for one, why in result.unnamed}
    if effect.key in unnamed:
        return unnamed[effect.key]
    if effect.key in found.denied:
        return CONTRADICTED
    return "needless" if joins(gain, found.case.gates) else "no_better"


def _evidence(found, result):
    """Of each name: what it changes of each block, and what was missing there without it."""
    blocks, parts = found.filters.blocks, []
    for one, side in product(result.names, SIDES):
        residuals = [state.residual_on(side) for state in (one.before, one.state)]
        columns = _evidence_of(found.case.stack(side), blocks.on(side), blocks.band, residuals)
        rows = len(columns["rows"])
        parts.append({"effect": [one.effect.id] * rows, "role": [side] * rows} | columns)
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


def _series(case, socs, before, after, filters):
    """Columns of all records: what was measured, both models, and which rows the errors count."""
    parts = []
    for side in SIDES:
        stack = case.stack(side)
        columns = {
            "test_time_second": stack.second,
            "current_ampere": stack.current_ampere,
            "celsius": stack.celsius,
            "soc": socs[side],
            "used": stack.used,
            "counted": filters.rows_on(side),
            "voltage_volt": stack.voltage_volt,
            "before_volt": stack.voltage_volt - before.residual_on(side),
            "after_volt": stack.voltage_volt - after.residual_on(side),
        }
        names = {"role": [side] * len(stack.file), "test": [stack.tests[k] for k in stack.file]}
        parts.append(names | {name: column.tolist() for name, column in columns.items()})
    return joined(parts)


def about_fit(case):
    """Capacity [Ah], lowest and highest mean temperature of the records fitted [degC]: dict.

    Also, where the dates are known, the time between the first and the last test [d].
    """
    stack = case.fit
    means = stack.mean_celsius
    known = {
        "fitted_celsius": [float(means.min()), float(means.max())],
        "capacity_ampere_hour": case.cell.capacity_ampere_hour,
    }
    return known if stack.age is None else known | {"aged_day": stack.aged_day}


def model_of(case, state):
    """A fitted model with its effects: all that `base.voltage` needs, with standard deviations.

    Also `about_fit`. start_soc : SoC at the start of each of the records fitted. start_shift_soc :
    by how much these usually lie above what was stated. healthy : effects that are in the plain
    model already, id and parameters, as healthy cells of the type have them.
    """
    stack = case.fit
    starts = base.starts_of(case.cell, stack, state.solution.values, state.effects)
    return about_fit(case) | {
        "ocv_soc": np.linspace(0.0, 1.0, len(case.cell.ocv_volt)).tolist(),
        "ocv_volt": np.asarray(case.cell.ocv_volt).tolist(),
        "hold": case.fit.hold,
        "tests": list(case.fit.tests),
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "std": stds(state.solution, parts_of(case.fit)),
        "start_soc": starts,
        "start_shift_soc": shift_of_starts(stack, starts),
        "effects": [effect.id for effect in state.effects],
        "healthy": [[key, dict(p)] for key, p in case.healthy],
    }
