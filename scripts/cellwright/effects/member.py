"""The model of a search, with its effects, as a member of a cell's model file.

Resistances, branches and OCV are read off that model at every knot of SoC and every temperature;
what no circuit holds goes into the blocks of `cellwright.circuits.instrument`.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import KINDS
from cellwright.circuits.instrument import words_of
from cellwright.circuits.model_file import std_name
from cellwright.circuits.temperature import GAS_CONSTANT, ZERO_CELSIUS_KELVIN, continued_ocv_at
from cellwright.effects import base
from cellwright.effects.columns import frees_of
from cellwright.effects.judge import unfitted
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.quantities import fields_at
from cellwright.effects.library.vocabulary import SLOW_TEST, in_order
from cellwright.effects.records import NEAR_END
from cellwright.identification.choice import FOLDS, score_of
from cellwright.identification.in_use import (
    Judged,
    decided,
    errors_of,
    fitted_records,
    simulated_errors,
)
from cellwright.numerics.least_squares import fit
from cellwright.records.blocks import cut_of
from cellwright.records.conditions import AT_REST_C_RATE, same_temperature
from cellwright.records.record import cell_temperature
from cellwright.refusal import Refusal

STEPS_OF_FOLD = 4  # of its fit, each with new derivatives of the effects
NAME = "2RC+effects"
KNOTS = np.linspace(0.0, 1.0, 61)  # four to each of the OCV's error, and to every course's bend
PLAIN_PAIRS = 2  # branches of the plain circuit, the first ones
PROBED = ("counting", "resistance", "ocv")  # stages that a circuit holds by itself
FURTHEST_KELVIN = 15.0


def effect_member(effect_model, model, celsius, library=LIBRARY):
    """Member of a model file that gives the voltages of the model of a search.

    Parameters
    ----------
    effect_model : dict, see `story.result.Finding`: capacity_ampere_hour, ocv_soc, ocv_volt, hold,
        values, std, effects (ids), and start_shift_soc, by which its scale of the SoC lies above
        the counted one.
    model : dict of schema cellwright-model/2, whose capacity and OCV tables it stands beside.
    celsius : temperatures at which it has conditions [degC].
    library : dict of Effect by id, which has the effects of that model.

    Returns
    -------
    member : dict; its conditions have no error of the fit yet.

    Raises
    ------
    Refusal : an effect that the library does not have, or OCV knots that are not even.
    """
    unknown = [name for name in effect_model["effects"] if name not in library]
    if unknown:
        raise Refusal(f"effects {', '.join(unknown)} are not in the library")
    effects = in_order([library[name] for name in effect_model["effects"]], library)
    in_courses, where = ("resistance", "ocv"), "docs/missing-effect-library.md"
    for effect in effects:
        if not (effect.stage in in_courses or effect.circuit or effect.blocks):
            raise Refusal(f"effect {effect.id!r} has no place in a model file: see {where}")
    cell = base.Cell(
        effect_model["capacity_ampere_hour"], np.asarray(effect_model["ocv_volt"], float)
    )
    spacing = np.diff(effect_model["ocv_soc"])
    if np.ptp(spacing) > 1e-6:
        raise Refusal(f"OCV knots are {spacing.min():g} to {spacing.max():g} apart, wanted even")
    searched = Searched(cell, effect_model, effects)
    conditions = [_condition(searched, model["ocv"], float(t)) for t in celsius]
    tested = cell.capacity_ampere_hour / model["capacity_ampere_hour"]
    tested = tested * (1.0 + effect_model["values"].get("capacity", 0.0))
    return {
        "model": NAME,
        "effects": list(effect_model["effects"]),
        "left_out_rmse_volt": None,
        "hold": effect_model["hold"],
        "conditions": conditions,
        **_blocks(effects, effect_model["values"], tested, conditions[0]["branches"]),
    }


class Searched(NamedTuple):
    """Model of a search: base.Cell, its document, and its effects."""

    cell: base.Cell
    document: dict
    effects: list


def temperatures(courses, stated, effects):
    """Temperatures at which a member has conditions: those tested, and some between them [degC].

    Parameters
    ----------
    courses : temperature of each record, (n,) each [degC].
    stated : temperature of the chamber of each, or None [degC].
    effects : ids of the library. Where OCV or time constants move with temperature no two may lie
        far apart, and the coldest and warmest that were measured count as well: a look-up of them
        is straight in 1/T, and ends there.
    """
    means = [
        float(np.mean(course)) if chamber is None else float(chamber)
        for course, chamber in zip(courses, stated, strict=True)
    ]
    kept = distinct(sorted(means))
    if not any(LIBRARY[name].bent_over_temperature for name in effects if name in LIBRARY):
        return kept
    ends = [float(np.floor(min(c.min() for c in courses)))]
    ends += [float(np.ceil(max(c.max() for c in courses)))]
    measured = distinct(sorted([*kept, *ends]))
    counts = [(a, b, int(np.ceil((b - a) / FURTHEST_KELVIN))) for a, b in pairwise(measured)]
    inner = [a + (b - a) * k / count for a, b, count in counts for k in range(count)]
    return [*inner, measured[-1]]


def distinct(ordered):
    """Sorted temperatures without those that are the same as the one before [degC].

    Parameters
    ----------
    ordered : list of temperatures, ascending [degC].
    """
    kept = ordered[:1]
    for celsius in ordered[1:]:
        kept += [celsius] if not same_temperature(celsius, kept[-1]) else []
    return kept


def _condition(searched, tables, celsius):
    """Resistances, branches and OCV of the model of a search at one temperature."""
    values, std = searched.document["values"], searched.document.get("std", {})
    out, back = (_probed(searched, celsius, sign) for sign in (-1.0, 1.0))
    r0, ways = _by_direction(out.r0, back.r0)
    r0 = r0 + values.get(base.LEAD, 0.0)
    branches = [_branch("R_two_way", None, **ways)] if ways else []
    pairs = []
    for n, *ohms, tau in zip((1, 2), out.slow_ohm, back.slow_ohm, out.slow_second, strict=True):
        r, ways = _by_direction(*ohms)
        stds = {"tau_std": std.get(f"log_tau{n}")}
        pairs.append(_branch("RC", std.get(f"log_r{n}"), r_ohm=r, tau_second=tau, **stds))
        branches += [_branch("RC_two_way", None, tau_second=tau, **stds, **ways)] if ways else []
    branches = [*pairs, *branches]
    capacity = _probed(searched, celsius, -1.0, ("current", *PROBED)).capacity
    for effect in (e for e in searched.effects if e.circuit):
        r0, kind, parameters = effect.circuit(effect.sizes_of(values), r0, capacity, KNOTS)
        if KINDS[kind].output == "soc":  # of particles, which even out slower in the cold
            parameters = {name: one * out.tau_factor for name, one in parameters.items()}
        if "exchange_ampere" in parameters:
            parameters["exchange_ampere"] = parameters["exchange_ampere"] * out.exchange_factor
        branches.append(_branch(kind, None, **parameters))
    shift = out.ocv - continued_ocv_at(tables, KNOTS, celsius)
    return {
        "ambient_temperature_celsius": celsius,
        "soc": KNOTS.tolist(),
        "r0_ohm": _listed(r0),
        "r0_std_ohm": _spread(r0, std.get("log_r0")),
        "branches": branches,
        "ocv_shift_volt": _listed(shift),
        "ocv_scale": {"missing": 0.0, "stretch": 0.0},
        "activation_energy_joule_per_mole": _energy(searched, celsius),
        "at_bound": [],
    }


def _by_direction(discharge_ohm, charge_ohm):
    """The smaller of two resistances, and by name what either direction has beyond it [ohm]."""
    least = np.minimum(discharge_ohm, charge_ohm)
    more = {"r_charge_ohm": charge_ohm - least, "r_discharge_ohm": discharge_ohm - least}
    return least, more if any(map(np.any, more.values())) else {}


def _probed(searched, celsius, sign, stages=PROBED):
    """Fields of the model of a search at every knot of counted SoC, at C/1000 of the sign given.

    stages : of the effects that act.
    """
    cell, values = searched.cell, searched.document["values"]
    capacity = cell.capacity_ampere_hour
    soc = np.clip(KNOTS + searched.document["start_shift_soc"], *base.SOC_LIMITS)
    sizes = {"capacity_ampere_hour": capacity * (1.0 + values["capacity"])}
    ocv = base.looked_up(cell, [values[name] for name in base.OCV_NAMES], soc)
    acting = [e for stage in stages for e in searched.effects if e.stage == stage]
    about = {"soc": soc, "celsius": celsius, "current": sign * 1e-3 * capacity}
    pairs = [(effect, effect.sizes_of(values)) for effect in acting]
    return fields_at(values | sizes, pairs, **about, ocv=ocv)


def _energy(searched, celsius):
    """Activation energy of the sum of the resistances at half charge [J/mol]."""
    kelvin = celsius + ZERO_CELSIUS_KELVIN + np.array([-0.5, 0.5])
    fields = [_probed(searched, t - ZERO_CELSIUS_KELVIN, -1.0) for t in kelvin]
    logs = [np.log(_total_ohm(at_celsius)) for at_celsius in fields]
    return float(GAS_CONSTANT * (logs[0] - logs[1]) / (1.0 / kelvin[0] - 1.0 / kelvin[1]))


def _total_ohm(fields):
    """Sum of the ohmic resistance and those of both RC pairs at half charge [ohm]."""
    return sum(
        np.broadcast_to(r, KNOTS.shape)[len(KNOTS) // 2] for r in (fields.r0, *fields.slow_ohm)
    )


def _branch(kind, log_std, tau_std=None, **parameters):
    """Entry of a branch. log_std, tau_std: relative deviations of resistance and time constant."""
    entry = {"kind": kind}
    spreads = {"r_ohm": log_std, "tau_second": tau_std}
    for name, value in parameters.items():
        entry[name] = _listed(value)
        entry[std_name(name)] = _spread(value, spreads.get(name))
    return entry


def _listed(value):
    return np.broadcast_to(np.asarray(value, float), KNOTS.shape).tolist()


def _spread(value, relative):
    return [None] * len(KNOTS) if relative is None else _listed(np.abs(value) * relative)


def _blocks(effects, values, tested, branches):
    """Blocks of a member: what no circuit holds, of the effects in the model alone."""
    sizes = {"capacity_relative": tested - 1.0, "capacity_test_relative": tested - 1.0}
    blocks = {"counting": {name: float(size) for name, size in sizes.items()}}
    for effect in (e for e in effects if e.blocks):
        blocks = effect.blocks(effect.sizes_of(values), blocks)
    if any(KINDS[branch["kind"]].follows_charge for branch in branches):
        blocks["history"] = {"near_end_soc": NEAR_END}
    if "own_heat" in blocks:
        # The search takes the heat of the plain circuit, without the loss of slow diffusion.
        relaxing = [k for k, b in enumerate(branches, 1) if _relaxes(KINDS[b["kind"]])]
        blocks["own_heat"] |= {"branches_apart": relaxing[PLAIN_PAIRS:]}
    return blocks


def _relaxes(kind):
    """Whether a kind of branch is ohmic in the end, and gets there with time."""
    return kind.linear and kind.output == "volt" and "tau_second" in kind.parameters


def folds(case, state, noise, *, split_rest_second):
    """Model of a search fitted without each fold of its blocks, a block being a load and its rest.

    Every fourth block is left out together with its like, as in the choice between members of the
    circuit family (`identification.choice`). Effects and noise stay as they are.

    Parameters
    ----------
    case : case.Case. state : state.State, the model with its effects. noise : noise.Noise.
    split_rest_second : shortest rest that ends a block [s].

    Returns
    -------
    folds : list of dict: values, start_soc and start_shift_soc, as in the model; blocks, list of
        [test, from, until] in seconds of the test. Empty where the records fitted are one block.
    """
    numbers, spans = blocks_of_case(case, split_rest_second)
    count = min(FOLDS, len(spans))
    if count < 2:
        return []
    values, free = unfitted(case)
    of_effects = [parameter for effect in state.effects for parameter in frees_of(effect)]
    free = (*free, *of_effects)
    renew = tuple(parameter.name for parameter in of_effects)
    folds = []
    for fold in range(count):
        kept = case.fit.used & (numbers % count != fold)
        part = case._replace(fit=case.fit._replace(used=kept))
        problem = part.problem(state.effects, free, part.filters(noise, values))
        start = state.solution
        solution = fit(
            problem, start.values, columns=start.columns, renew=renew, steps=STEPS_OF_FOLD
        )
        blocks_of_fold = [span for number, span in enumerate(spans) if number % count == fold]
        values_of_fold = {name: float(value) for name, value in solution.values.items()}
        starts = base.starts_of(case.cell, case.fit, solution.values, state.effects)
        shift = shift_of_starts(case.fit, starts)
        of_starts = {"start_soc": starts, "start_shift_soc": shift}
        folds.append({"values": values_of_fold, **of_starts, "blocks": blocks_of_fold})
    return folds


def shift_of_starts(stack, starts):
    """By how much the records of a fit usually begin above the SoC that is stated or counted [1].

    A cell that was charged by CC-CV rests a little below the full end of its slow test, and all its
    records begin there. Whoever uses the model counts from full: its scale is moved by so much.

    Parameters
    ----------
    stack : records.Stack of the fit. starts : SoC at the start of each test, see `starts_of`.
    """
    rows = zip(stack.tests, stack.kinds, stack.soc_at_start.tolist(), strict=True)
    above = [starts[test] - stated for test, kind, stated in rows if kind != SLOW_TEST]
    return float(np.median(above)) if above else 0.0


def blocks_of_case(case, rest_second):
    """Number of the block of each row, and [test, from, until] of each; unused rows: number −1.

    Blocks as of the members of the family, see `blocks.cut_of`.

    Parameters
    ----------
    case : case.Case. rest_second : shortest rest that ends a block [s].
    """
    rest_ampere = AT_REST_C_RATE * case.cell.capacity_ampere_hour
    rest = {"rest_second": rest_second, "rest_ampere": rest_ampere}
    stack, numbers, spans = case.fit, np.full(len(case.fit.file), -1), []
    rows_of = [np.flatnonzero(stack.file == file) for file in range(len(stack.tests))]
    columns = [(stack.second[rows], stack.current_ampere[rows]) for rows in rows_of]
    means = [float(np.mean(stack.celsius[rows])) for rows in rows_of]
    kept = np.array(distinct(sorted(means)))
    at_celsius = [int(np.abs(kept - celsius).argmin()) for celsius in means]
    conditions = [[] for _ in kept]
    for condition, kind, record in zip(at_celsius, stack.kinds, columns, strict=True):
        conditions[condition].append((kind, *record))
    cut = cut_of(conditions, **rest)
    for test, rows, record in zip(stack.tests, rows_of, columns, strict=True):
        block = cut(*record, **rest)
        for number in np.unique(block[stack.used[rows]]):
            inside = rows[block == number]
            numbers[inside] = len(spans)
            spans.append([test, float(stack.second[inside[0]]), float(stack.second[inside[-1]])])
    return numbers, spans


def finished(model, basis, cell, tests, effect_model, *, split_rest_second):
    """A cell's model as the pipeline uses it: its member of the effects added, and one chosen.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, from whatever source.
    basis : dict, from `basis.basis`. cell : CellFacts.
    tests : list of MeasuredTest: those fitted, and those that effects were searched in.
    effect_model : dict, see `with_effects`, or None where nothing was searched.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    model : dict of the same schema. rows : list of dict, see `identification.in_use.decided`;
        none for a
        borrowed model, whose cell has no records that its members were fitted to.
    """
    if not model.get("left_out"):
        return model, []
    conditions = fitted_records(model, basis, cell, tests, split_rest_second=split_rest_second)
    searched = {}
    # Effects too small for a name may be in the model of a search that names nothing.
    if effect_model and effect_model["effects"] and "folds" in effect_model:
        try:
            model, searched[NAME] = with_effects(model, effect_model, tests, conditions)
        except Refusal as refusal:
            model = model | {"notes": [*model["notes"], f"{NAME} not made: {refusal}"]}
    return decided(model, conditions, searched)


def with_effects(model, effect_model, tests, conditions):
    """A cell's model with a member that holds the effects of a search, and its error by blocks.

    Every block of the records fitted is predicted by the effects' model fitted without that block;
    a record that took no part in the search's fit by the model as it is. A record begins at the SoC
    that was fitted with the rest of it, as the family's members have its error in their OCV. The
    member's own scale holds what the starts of all records have in common.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    effect_model : dict, see `effect_member`, with `start_soc` (of the search's fit) and `folds`
        (see `folds`).
    tests : list of MeasuredTest, whose temperatures the member is to hold.
    conditions : list of lists of in_use.FittedRecord, one a condition of the model.

    Returns
    -------
    model : dict of the same schema, the member last. judged : in_use.Judged, of the same blocks as
        the family's members.

    Raises
    ------
    Refusal : as `effect_member`.
    """
    courses = [cell_temperature(*test)[0] for test in tests]
    stated = [test.facts.ambient_temperature_celsius for test in tests]
    celsius = temperatures(courses, stated, effect_model["effects"])
    folds = effect_model["folds"]
    fits = [effect_model, *(effect_model | fold for fold in folds)]
    members = [effect_member(fit, model, celsius) for fit in fits]
    models = [model | {"members": [*model["members"], member]} for member in members]
    errors = [[_errors(record, models, fits) for record in part] for part in conditions]
    member = models[0]["members"][-1]
    whole = np.concatenate([by_fit[0] for part in errors for by_fit in part])
    fitted = {"fit_rmse_volt": float(np.sqrt(np.mean(whole**2))), "samples": len(whole)}
    # No change of a cell's resistances over one temperature is none as far as its records went.
    flat = not any(c["activation_energy_joule_per_mole"] for c in member["conditions"])
    if flat and len(temperatures(courses, stated, ())) == 1:
        reach = max(float(np.abs(course - celsius[0]).max()) for course in courses)
        fitted |= {"activation_energy_kelvin": reach}
    for condition in member["conditions"]:
        condition |= fitted | {
            "tests": [fitted_record.record.test for part in conditions for fitted_record in part]
        }
    pairs = list(zip(conditions, errors, strict=True))
    judged = Judged(
        [_score(part, of_part, folds) for part, of_part in pairs],
        *simulated_errors(conditions, [[by_fit[0] for by_fit in part] for part in errors]),
    )
    notes = [*model["notes"], *(f"{NAME}: {words}" for words in words_of(member))]
    return models[0] | {"notes": notes}, judged


def _errors(fitted_record, models, fits):
    """Errors of a record by the whole fit and by each fold's, (1 + folds, used rows) [V]."""
    record = fitted_record.record
    soc, errors = record.soc, []
    for model, effect_model in zip(models, fits, strict=True):
        start = effect_model["start_soc"].get(record.test)
        fitted = soc[0] if start is None else start - effect_model["start_shift_soc"]
        moved = record._replace(soc=soc + (fitted - soc[0]))
        errors.append(errors_of(model, NAME, fitted_record._replace(record=moved)))
    return np.array(errors)


def _score(records, errors, folds):
    """Error of each block of one condition, each row by the model that was fitted without it."""
    held_out = []
    for fitted_record, by_fit in zip(records, errors, strict=True):
        record = fitted_record.record
        fold = _fold_of(record.test, record.test_time_second[record.used], folds)
        held_out.append(by_fit[fold + 1, np.arange(len(fold))])
    blocks = np.concatenate([fitted_record.block for fitted_record in records])
    return score_of(blocks, np.concatenate(held_out))


def _fold_of(test, time_second, folds):
    """Number of the fold whose fit lacks a time of a test; −1: the test was not fitted at all."""
    spans = [
        (begin, k) for k, fold in enumerate(folds) for t, begin, _ in fold["blocks"] if t == test
    ]
    if not spans:
        return np.full(len(time_second), -1)
    begins, number = (np.array(column) for column in zip(*sorted(spans), strict=True))
    at = np.searchsorted(begins, time_second, side="right") - 1
    return number[np.maximum(at, 0)]
