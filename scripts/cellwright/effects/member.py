"""A found model with its effects as a member of a cell's model file, judged like any other.

What a circuit can hold is asked of the found model itself, at every knot of SoC and every
temperature; the rest goes into the blocks of `cellwright.circuits.instrument`.
"""

from itertools import pairwise

import numpy as np

from cellwright.circuits.instrument import FOLLOWS, words_of
from cellwright.circuits.model_file import std_name
from cellwright.circuits.temperature import GAS_CONSTANT, ZERO_CELSIUS_KELVIN, continued_ocv_at
from cellwright.effects import base, plain
from cellwright.effects.case import filters_of, problem_of, steep
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.overpotential import DIFFUSION_KINDS
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.records import NEAR_END, stacked
from cellwright.effects.search import POLISH_STEPS, frees_of
from cellwright.identification.choice import (
    FOLDS,
    Judged,
    Score,
    decided,
    errors_of,
    fitted_records,
    inner_rmse,
)
from cellwright.numerics.least_squares import fit
from cellwright.numerics.statistics import rms
from cellwright.records.anchor import REST_C_RATE
from cellwright.records.record import blocks, cell_temperature, record_of
from cellwright.refusal import Refusal

NAME = "2RC+effects"
KNOTS = np.linspace(0.0, 1.0, 61)  # four to each of the OCV's error, and to every course's bend
PLAIN_PAIRS = 2  # branches of the plain circuit, the first ones
PROBED = ("counting", "resistance", "ocv")  # stages that a circuit holds by itself
SAME_KELVIN, FURTHEST_KELVIN = 2.0, 15.0


def effect_member(found, model, celsius, library=LIBRARY):
    """Member of a model file that gives the voltages of a found model.

    Parameters
    ----------
    found : dict, see `finding.Finding`: capacity_ampere_hour, ocv_soc, ocv_volt, hold, values, std
        and effects (ids).
    model : dict of schema cellwright-model/2, whose capacity and OCV tables it stands beside.
    celsius : temperatures at which it has conditions [degC].
    library : dict of Effect by id, which has the effects of the found model.

    Returns
    -------
    member : dict; its conditions say nothing of how well they fit yet.

    Raises
    ------
    Refusal : an effect that the library does not have, or OCV knots that are not even.
    """
    unknown = [name for name in found["effects"] if name not in library]
    if unknown:
        raise Refusal(f"effects {', '.join(unknown)} are not in the library")
    effects = in_order([library[name] for name in found["effects"]], library)
    for effect in effects:
        _check_place(effect)
    cell = base.Cell(found["capacity_ampere_hour"], np.asarray(found["ocv_volt"], float))
    spacing = np.diff(found["ocv_soc"])
    if np.ptp(spacing) > 1e-6:
        raise Refusal(f"OCV knots are {spacing.min():g} to {spacing.max():g} apart, wanted even")
    conditions = [_condition(cell, found, effects, model["ocv"], float(t)) for t in celsius]
    tested = cell.capacity_ampere_hour / model["capacity_ampere_hour"]
    tested = tested * (1.0 + found["values"].get("capacity", 0.0))
    return {
        "model": NAME,
        "effects": list(found["effects"]),
        "left_out_rmse_volt": None,
        "hold": found["hold"],
        "conditions": conditions,
        **_blocks(effects, found["values"], tested, conditions[0]["branches"]),
    }


def _check_place(effect):
    """Refuses an effect that neither a course, a branch nor a block of a member would hold."""
    if effect.stage in ("resistance", "ocv") or effect.circuit or effect.blocks:
        return
    raise Refusal(f"effect {effect.id!r} has no place in a model file: see docs/add-an-effect.md")


def temperatures(courses, stated, effects):
    """Temperatures at which a member has conditions: those tested, and what lies between them.

    Parameters
    ----------
    courses : temperature of each record, (n,) each [degC].
    stated : temperature of the chamber of each, or None [degC].
    effects : ids. Where the OCV moves with temperature no two may lie far apart, and the warmest
        that was measured counts as well: there a look-up is straight in 1/T, and ends.
    """
    means = [
        float(np.mean(course)) if known is None else float(known)
        for course, known in zip(courses, stated, strict=True)
    ]
    kept = _apart(sorted(means))
    if "entropic_ocv" not in effects:
        return kept
    ends = [float(np.floor(min(c.min() for c in courses)))]
    ends += [float(np.ceil(max(c.max() for c in courses)))]
    known = _apart(sorted([*kept, *ends]))
    counts = [(a, b, int(np.ceil((b - a) / FURTHEST_KELVIN))) for a, b in pairwise(known)]
    inner = [a + (b - a) * k / count for a, b, count in counts for k in range(count)]
    return [*inner, known[-1]]


def _apart(ordered):
    found = ordered[:1]
    for one in ordered[1:]:
        found += [one] if one - found[-1] > SAME_KELVIN else []
    return found


def _condition(cell, found, effects, tables, celsius):
    """Resistances, branches and OCV of the found model at one temperature."""
    values, std = found["values"], found.get("std", {})
    out, back = (_probed(cell, found, effects, celsius, sign) for sign in (-1.0, 1.0))
    gain = 1.0 + values.get("current_gain.gain_relative", 0.0)
    r0, excess = np.minimum(out.r0, back.r0), out.r0 - back.r0
    branches = [
        _branch("RC", std.get(f"log_r{n}"), r_ohm=r, tau_second=tau, tau_std=std.get(f"log_tau{n}"))
        for n, r, tau in ((1, out.r1, out.tau1), (2, out.r2, out.tau2))
    ]
    if np.any(excess != 0.0):
        ways = {"r_charge_ohm": np.maximum(-excess, 0.0), "r_discharge_ohm": np.maximum(excess, 0)}
        branches.append(_branch("R_two_way", None, **ways))
    for effect in (one for one in effects if one.circuit):
        r0, kind, parameters = effect.circuit(effect.sizes_of(values), r0, out.capacity / gain)
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
        "activation_energy_joule_per_mole": _energy(cell, found, effects, celsius),
        "at_bound": [],
    }


def _probed(cell, found, effects, celsius, sign):
    """Fields of the found model at every knot, at rest but for the sign of the current."""
    capacity = cell.capacity_ampere_hour
    current = sign * 1e-3 * capacity
    rows = [record_of([0.0], [current], [0.0], soc, celsius=celsius) for soc in KNOTS]
    stack = stacked(rows, capacity_ampere_hour=capacity, hold=found["hold"])
    starts = {f"soc0[{k}]": float(soc) for k, soc in enumerate(KNOTS)}
    held = [effect for effect in effects if effect.stage in PROBED]
    return base.fields_of(cell, stack, found["values"] | starts, held)


def _energy(cell, found, effects, celsius):
    """Activation energy of the sum of the resistances at half charge [J/mol]."""
    kelvin = celsius + ZERO_CELSIUS_KELVIN + np.array([-0.5, 0.5])
    fields = [_probed(cell, found, effects, t - ZERO_CELSIUS_KELVIN, -1.0) for t in kelvin]
    logs = [np.log(_total(one)) for one in fields]
    return float(GAS_CONSTANT * (logs[0] - logs[1]) / (1.0 / kelvin[0] - 1.0 / kelvin[1]))


def _total(fields):
    return sum(
        np.broadcast_to(r, KNOTS.shape)[len(KNOTS) // 2] for r in (fields.r0, fields.r1, fields.r2)
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
    """What no circuit holds; a name stands only where its effect was found."""
    sizes = {"capacity_relative": tested - 1.0, "capacity_test_relative": tested - 1.0}
    blocks = {"counting": {name: float(size) for name, size in sizes.items()}}
    for effect in (one for one in effects if one.blocks):
        blocks = effect.blocks(effect.sizes_of(values), blocks)
    if any(branch["kind"] in FOLLOWS for branch in branches):
        blocks["history"] = {"near_end_soc": NEAR_END}
    if "own_heat" in blocks:
        # The heat was that of the plain circuit: what slow diffusion loses was not among it.
        apart = [k for k, one in enumerate(branches, 1) if one["kind"] in DIFFUSION_KINDS]
        blocks["own_heat"] |= {"branches_apart": apart[PLAIN_PAIRS:]}
    return blocks


def folds(case, state, noise, *, split_rest_second):
    """Values of a found model without each fold of the blocks, a block being a load and its rest.

    Every fourth block is left out together with its like, as in the choice between members of the
    circuit family (`models.selection.left_out`). Effects and noise stay as found.

    Parameters
    ----------
    case : Case. state : case.State, the model with its effects. noise : noise.Noise.
    split_rest_second : shortest rest that ends a block [s].

    Returns
    -------
    folds : list of dict: values, as in the model; blocks, list of [test, from, until] in seconds
        of the test. Empty where the records fitted are one block.
    """
    numbers, spans = _blocks_of_case(case, split_rest_second)
    count = min(FOLDS, len(spans))
    if count < 2:
        return []
    values = plain.first_values(case.cell, case.fit)
    own = [one for effect in state.effects for one in frees_of(effect)]
    free = (*plain.frees(case.fit, values, case.tolerance), *own)
    renew = tuple(one.name for one in own)
    found = []
    for fold in range(count):
        kept = case.fit.used & (numbers % count != fold)
        part = case._replace(fit=case.fit._replace(used=kept))
        filters = filters_of(part, noise, steep(part, values))
        problem = problem_of(part, state.effects, free, filters)
        start = state.solution
        solution = fit(
            problem, start.values, columns=start.columns, renew=renew, steps=POLISH_STEPS
        )
        left = [span for number, span in enumerate(spans) if number % count == fold]
        found.append({"values": _plain(solution.values), "blocks": left})
    return found


def _blocks_of_case(case, rest_second):
    """Number of the block of each row, and [test, from, until] of each; unused rows: number −1."""
    stack, numbers, spans = case.fit, np.full(len(case.fit.file), -1), []
    rest_ampere = REST_C_RATE * case.cell.capacity_ampere_hour
    for file, test in enumerate(stack.tests):
        rows = np.flatnonzero(stack.file == file)
        second, current = stack.second[rows], stack.current_ampere[rows]
        block = blocks(second, current, rest_second=rest_second, rest_ampere=rest_ampere)
        for one in np.unique(block[stack.used[rows]]):
            inside = rows[block == one]
            numbers[inside] = len(spans)
            spans.append([test, float(stack.second[inside[0]]), float(stack.second[inside[-1]])])
    return numbers, spans


def _plain(values):
    return {name: float(value) for name, value in values.items()}


def finished(model, basis, cell, tests, found, *, split_rest_second):
    """A cell's model as the pipeline uses it: with the effects found, and its member chosen.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, from whatever source.
    basis : dict, from `basis.basis`. cell : CellFacts.
    tests : list of MeasuredTest: those fitted, and those that effects were searched in.
    found : dict, see `with_effects`, or None where nothing was searched.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    model : dict of the same schema. rows : list of dict, see `models.choice.decided`; none for a
        borrowed model, whose cell has no records that its members were fitted to.
    """
    if not model.get("left_out"):
        return model, []
    conditions = fitted_records(model, basis, cell, tests, split_rest_second=split_rest_second)
    searched = {}
    if found and found["effects"]:
        try:
            model, searched[NAME] = with_effects(model, found, tests, conditions)
        except Refusal as refusal:
            model = model | {"notes": [*model["notes"], f"{NAME} not made: {refusal}"]}
    return decided(model, conditions, searched)


def with_effects(model, found, tests, conditions):
    """A cell's model with a member that holds the effects found, and how that member does.

    Every block of the records fitted is predicted by the effects' model fitted without that block;
    a record that took no part in the search's fit by the model as it is. A record begins at the SoC
    that was found with the rest of it, as the family's members have its error in their OCV.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    found : dict, see `model.effect_member`, with `tests` (of the search's fit) and `folds`
        (`left_out.folds`).
    tests : list of MeasuredTest, whose temperatures the member is to hold.
    conditions : list of lists of choice.FittedRecord, one a condition of the model.

    Returns
    -------
    model : dict of the same schema, the member last. judged : choice.Judged, of the same blocks as
        the family's members.

    Raises
    ------
    Refusal : as `effect_member`.
    """
    courses = [cell_temperature(*test)[0] for test in tests]
    stated = [test.facts.ambient_temperature_celsius for test in tests]
    known = temperatures(courses, stated, found["effects"])
    fits = [found, *(found | {"values": one["values"]} for one in found["folds"])]
    models = [_with(model, effect_member(one, model, known)) for one in fits]
    errors = [[_errors(one, models, fits) for one in part] for part in conditions]
    member = models[0]["members"][-1]
    whole = np.concatenate([one[0] for part in errors for one in part])
    fitted = {"fit_rmse_volt": rms(whole), "samples": len(whole)}
    for condition in member["conditions"]:
        condition |= fitted | {"tests": [one.record.test for part in conditions for one in part]}
    pairs = list(zip(conditions, errors, strict=True))
    judged = Judged(
        [_score(part, of_part, found["folds"]) for part, of_part in pairs],
        np.array([inner_rmse(part, [one[0] for one in of_part]) for part, of_part in pairs]),
    )
    notes = [*model["notes"], *(f"{NAME}: {told}" for told in words_of(member))]
    return models[0] | {"notes": notes}, judged


def _with(model, member):
    return model | {"members": [*model["members"], member]}


def _errors(one, models, fits):
    """Errors of a record by the whole fit and by each fold's, (1 + folds, used rows) [V]."""
    soc, found = one.record.soc, []
    for model, fitted in zip(models, fits, strict=True):
        names = {test: f"soc0[{k}]" for k, test in enumerate(fitted["tests"])}
        start = fitted["values"].get(names.get(one.record.test), soc[0])
        moved = one._replace(record=one.record._replace(soc=soc + (start - soc[0])))
        found.append(errors_of(model, NAME, moved))
    return np.array(found)


def _score(records, errors, folds):
    """Error of each block of one condition, each row by the model that was fitted without it."""
    unseen = []
    for one, by_fit in zip(records, errors, strict=True):
        record = one.record
        fold = _fold_of(record.test, record.test_time_second[record.used], folds)
        unseen.append(by_fit[fold + 1, np.arange(len(fold))])
    _, at = np.unique(np.concatenate([one.block for one in records]), return_inverse=True)
    rows = np.bincount(at)
    return Score(np.bincount(at, np.concatenate(unseen) ** 2) / rows, rows)


def _fold_of(test, time_second, folds):
    """Number of the fold that left a time of a test out; −1: the test was not in the fit at all."""
    spans = [
        (begin, k) for k, one in enumerate(folds) for t, begin, _ in one["blocks"] if t == test
    ]
    if not spans:
        return np.full(len(time_second), -1)
    begins, number = (np.array(column) for column in zip(*sorted(spans), strict=True))
    at = np.searchsorted(begins, time_second, side="right") - 1
    return number[np.maximum(at, 0)]
