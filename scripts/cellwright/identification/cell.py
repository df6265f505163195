"""The model of one cell from its own tests: every condition, every member of the family."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import member_named
from cellwright.circuits.model_file import condition_entry, ocv_from_slow_branch
from cellwright.circuits.parameters import model_result
from cellwright.circuits.particle import NAME as PARTICLE
from cellwright.circuits.particle import compiled, to_document
from cellwright.circuits.temperature import ocv_at, resistance_factor
from cellwright.identification import particle
from cellwright.identification.choice import SURE, choose, left_out
from cellwright.identification.condition import ABSENT_SECOND
from cellwright.identification.edges import uncounted_edges, with_share
from cellwright.identification.identify import (
    activation_of,
    at_activation_energy,
    data_of,
    limits_of,
    prompt_resistance,
    series_of,
)
from cellwright.identification.identify import identify as identify_condition
from cellwright.identification.messages import say
from cellwright.identification.ocv_shape import ocv_from_loads, shape_records
from cellwright.identification.search import shared_of
from cellwright.messages import listed
from cellwright.numerics.compare import compare
from cellwright.protocols.ocv.gap import largest_hysteresis
from cellwright.records import inputs
from cellwright.records.basis import capacities_of_checkups, scale_in_words
from cellwright.records.blocks import blocks_of_used, columns_of, cut_of
from cellwright.records.conditions import (
    AT_REST_C_RATE,
    REFERENCE_CELSIUS,
    of_first_checkup,
    same_rate,
    stated_or_reference,
)
from cellwright.records.record import lone_loads, records_by_temperature
from cellwright.refusal import Refusal
from cellwright.settings import Models

MODELS = Models()
SCHEMA = "cellwright-model/2"
GRID = np.linspace(0.0, 1.0, 201)
PULSED_SPACING, DRIVEN_SPACING = 0.1, 0.05


class Identified(NamedTuple):
    """Identification at one temperature: OCV table, entries and scores by member, notes, the
    relative standard deviation of capacity and counted charge [1], and what a particle is fitted
    to: records, the same as they were fitted, blocks of these (see `particle.task_of`)."""

    ocv: dict
    entries: dict
    scores: dict
    notes: list
    counted_std: float
    fitted: tuple = ()


def identify(
    cell, basis, tests, *, members=MODELS.members, split_rest_second=MODELS.split_rest_second
):
    """Equivalent circuits of a cell from its own tests, at every temperature it was tested at.

    1. Tests of the earliest check-up are grouped by chamber temperature; at each, HPPC tests are
    used where there are any, with the capacity tests beside them, else drives, and of a cell with
    neither capacity tests alone. Of a drive of role `split` only the odd blocks are fitted. Where
    the current stepped between two rows, and nothing counts when, the voltage tells (`edges`).
    2. Resistances are taken to the chamber's temperature with the activation energy that the
    temperatures show between them. 3. Where the OCV comes from one slow branch, its drop over the
    model's resistances is put back and the fit repeated. 4. The member that best predicts blocks
    left out of its fit is the chosen one.

    tests : of roles fit or split.
    members : of the family that are identified, such as "2RC" or "DRT+H"; "P" for a particle beside
        them.

    Returns content: schema cellwright-model/2; parameters: one row each. Raises Refusal: no OCV, or
    no test that can be fitted; the reasons are named. Source: docs/models.md,
    lab/methods.md.
    """
    cell, basis, tests = inputs.cell_facts(cell), inputs.basis(basis), inputs.tests(tests)
    if not basis["ocv"]:
        raise Refusal(
            "no OCV curve: no slow test of the cell or its type, and no rests that tell one"
        )
    young, later = of_first_checkup(tests)
    by_temperature, notes = records_by_temperature(
        young, basis, cell, split_rest_second=split_rest_second
    )
    if later:
        notes.append(f"not fitted, of a later check-up: {', '.join(later)}")
    capacity = basis["capacity_ampere_hour"]
    circuits = [name for name in members if name != PARTICLE]
    if not circuits:
        raise Refusal(f"members {', '.join(members)}: wanted a circuit too, for filters and packs")
    share, words = uncounted_edges(
        by_temperature, lambda one: _data(one, basis), capacity_ampere_hour=capacity
    )
    by_temperature = [with_share(one, share, capacity) for one in by_temperature]
    notes += filter(None, [words, scale_in_words(basis)])
    rest = {"rest_second": split_rest_second, "rest_ampere": AT_REST_C_RATE * capacity}
    rest["cut"] = cut_of(columns_of([one.records for one in by_temperature]), **rest)
    identified, energies = _identified(by_temperature, basis, circuits, rest, notes)
    if not identified:
        raise Refusal("; ".join(notes) or "no test can be fitted")
    scores = _scored_everywhere([condition.scores for condition in identified])
    if not any(len(score.rows) for parts in scores.values() for score in parts):
        raise Refusal("the data are one block: nothing can be left out to choose a model by")
    choice = choose(scores)
    joint, words = None, ""
    if PARTICLE in members:
        lone = lone_loads(young, by_temperature)
        settings = {"split_rest_second": split_rest_second}
        beside, about_lone = records_by_temperature(lone, basis, cell, **settings)
        notes += about_lone
        beside = [with_share(one, share, capacity) for one in beside]
        joint, words = _particle(identified, particle.of_lone_loads(beside), capacity)
    content = {
        "schema": SCHEMA,
        "cell": cell.cell,
        "capacity_ampere_hour": basis["capacity_ampere_hour"],
        "capacity_std_ampere_hour": basis.get("capacity_std_ampere_hour"),
        "borrowed_from": basis["borrowed_from"],
        "checkups": capacities_of_checkups(basis),
        "ocv": [condition.ocv for condition in identified],
        "members": [
            {"model": name, "left_out_rmse_volt": choice.rmse_volt[name]}
            | {"conditions": [condition.entries[name] for condition in identified]}
            for name in choice.rmse_volt
        ],
        "chosen": choice.name,
        "choice": choice.words,
        "particle": joint,
        "left_out": [
            {
                "ambient_temperature_celsius": condition.ocv["ambient_temperature_celsius"],
                "rows": condition.scores[choice.name].rows.tolist(),
                "square_volt2": {n: condition.scores[n].square_volt2.tolist() for n in scores},
            }
            for condition in identified
        ],
        "kind": _kind(by_temperature),
        "uncounted_edge_share": share,
        "notes": [*notes, *filter(None, [energies, _stretched(identified, choice.name), words])],
    }
    return model_result(content)


def _particle(identified, beside, capacity):
    """The cell as one particle at all temperatures, as it stands in a model file; None and why not
    where none can be fitted. And in words how it was found.

    beside : conditions of which no circuit is fitted, see `particle.of_lone_loads`.
    """
    if not compiled():
        return None, say("particle.not_compiled")
    conditions = [(one.ocv["ambient_temperature_celsius"], *one.fitted) for one in identified]
    curves = [one.ocv for one in identified]
    try:
        every = sorted([*conditions, *beside], key=lambda condition: condition[0])
        task = particle.task_of(every, curves, capacity_ampere_hour=capacity)
        fit = particle.fitted(task)
        scores = particle.left_out(task, fit, conditions)
        root = particle.root_of_covariance(task, fit)
    except Refusal as refusal:
        return None, say("particle.not_fitted", refusal=refusal)
    soc = np.concatenate([rows.record.soc[rows.record.used] for rows in task.rows])
    about = {
        "left_out": [[score.square_volt2.tolist(), score.rows.tolist()] for score in scores],
        "fitted_soc": [float(soc.min()), float(soc.max())],
        "basins": [list(basin) for basin in fit.basins],
        "posterior": [row[: number + 1].tolist() for number, row in enumerate(root)],
        "beside": [record.test for _, records, *_ in beside for record in records],
    }
    document = to_document(fit.particle, fit.std)
    (energy,), (std,) = (document[f"diffusion_joule_per_mole{end}"] for end in ("", "_std"))
    words = say("particle.energy", energy=energy / 1e3, std=std / 1e3)
    if len(fit.basins) > 1:
        ends = [say("particle.basin", energy=e / 1e3, cost=cost) for e, cost in fit.basins]
        words += "; " + say("particle.basins", ends=listed(ends))
    if about["beside"]:
        words += "; " + say("particle.beside", tests=listed(about["beside"]))
    return document | about, words


def _kind(by_temperature):
    """Kind of test that a model is from: pulses before drives before long loads."""
    kinds = {record.kind for fit_records in by_temperature for record in fit_records.records}
    return next(kind for kind in ("hppc", "drive", "capacity") if kind in kinds)


def _identified(by_temperature, basis, members, rest, notes):
    """List of Identified, one per temperature, and a sentence on the activation energies."""
    capacity, usable = basis["capacity_ampere_hour"], []
    for fit_records in by_temperature:
        try:
            _data(fit_records, basis)
            _refuse_own_curve(fit_records, _nearest(basis["ocv"], fit_records.celsius))
            usable.append(fit_records)
        except Refusal as refusal:
            notes.append(f"not identified at {fit_records.celsius:g} °C: {refusal}")
    if not usable:
        return [], ""
    energies, words = activation_of(
        usable, lambda identified: _data(identified, basis), capacity_ampere_hour=capacity
    )
    # A series is as long and begins alike at all temperatures, so that their models can be mixed;
    # each ends where its own rests end.
    low, high = zip(*(limits_of(_data(fit_records, basis)) for fit_records in usable), strict=True)
    series = series_of(min(low), max(high))
    mean_energy = float(np.mean([energy or 0.0 for energy in energies]))
    notes.append(_ends_in_words(usable, high))
    by_celsius, found = {}, None
    parts = zip(usable, energies, high, strict=True)
    for one, energy, longest in sorted(
        parts, key=lambda part: abs(part[0].celsius - REFERENCE_CELSIUS)
    ):
        # ASSUME: Diffusion in the particles slows in the cold by the factor by which resistance
        # grows. Its time is found once, at the temperature nearest 25 °C that shows one.
        second = found and found[0] * resistance_factor(one.celsius, found[1], mean_energy)
        ready = at_activation_energy(one, energy or 0.0)
        fixed = {"diffusion_second": second, "limits_second": (min(low), longest), "series": series}
        identified = _condition(ready, energy, basis, members, rest, fixed)
        notes += identified.notes
        if identified.entries:
            by_celsius[one.celsius] = identified
            found = found or _diffusion_found(identified, one.celsius)
    return [by_celsius[celsius] for celsius in sorted(by_celsius)], words


def _ends_in_words(by_temperature, longest_second):
    pairs = zip(by_temperature, longest_second, strict=True)
    ends = [say("model.end", second=second, celsius=one.celsius) for one, second in pairs]
    return say("model.ends", ends=", ".join(ends))


def _stretched(identified, name):
    """Sentence on temperatures at which a member stretches the SoC by more than what is counted may
    be off by, "" where there are none."""
    found = []
    for one in identified:
        stretch = one.entries[name]["ocv_scale"]["stretch"]
        if abs(stretch) > SURE * one.counted_std:
            celsius = one.ocv["ambient_temperature_celsius"]
            about = {"share": stretch, "celsius": celsius, "std": one.counted_std}
            found.append(say("model.stretch", **about))
    return say("model.stretched", listed=", ".join(found)) if found else ""


def _refuse_own_curve(fit_records, curve):
    """Refuse long loads that are no faster than the one of them that stands for the OCV."""
    if curve["branches"] not in ("discharge", "charge"):
        return
    slow = abs(curve[f"{curve['branches']}_current_ampere"])
    fastest = max(np.abs(record.current_ampere).max() for record in fit_records.records)
    if fastest <= slow or same_rate(fastest, slow):
        raise Refusal(
            f"the OCV is from {curve['test']} at {slow:.3g} A, and no load is faster: one rate "
            "cannot tell OCV and resistance apart; wanted loads at two rates, or a slow test"
        )


def _diffusion_found(identified, celsius):
    """Diffusion time [s] of a condition and its temperature [degC]; None where it shows none."""
    branches = [branch for entry in identified.entries.values() for branch in entry["branches"]]
    times = [b["tau_second"][0] for b in branches if b["kind"] == "diffusion"]
    times = [second for second in times if second > ABSENT_SECOND]
    return (times[0], celsius) if times else None


def _scored_everywhere(scores):
    """Scores of the members that could be fitted and scored at every temperature."""
    names = [name for name in scores[0] if all(name in by_member for by_member in scores)]
    return {name: [by_member[name] for by_member in scores] for name in names}


def _data(fit_records, basis):
    return data_of(
        fit_records.records,
        ocv_at(_with_temperature(basis["ocv"]), GRID, fit_records.celsius),
        capacity_ampere_hour=basis["capacity_ampere_hour"],
        capacity_std_ampere_hour=basis.get("capacity_std_ampere_hour"),
        spacing=PULSED_SPACING if fit_records.pulsed else DRIVEN_SPACING,
    )


def _condition(fit_records, energy, basis, members, rest, fixed):
    """Identified of every member that can be fitted at one temperature."""
    capacity, curve = basis["capacity_ampere_hour"], _nearest(basis["ocv"], fit_records.celsius)
    settings = {"capacity_ampere_hour": capacity, "celsius": fit_records.celsius}
    data, notes = _data(fit_records, basis), []
    shared = shared_of(data)
    if curve["branches"] in ("discharge", "charge"):
        slow = curve[f"{curve['branches']}_current_ampere"]
        first = identify_condition(data, member_named("DRT"), shared=shared, **settings).condition
        data = data._replace(ocv_volt=ocv_from_slow_branch(GRID, data.ocv_volt, slow, first))
        shared = shared_of(data)
    if any("+H" in name for name in members):
        shared, words = _with_bound_hysteresis(shared, basis, fixed, settings)
        data = shared.data
        notes.append(words)
    blocks = blocks_of_used(data.records, **rest)
    block = np.concatenate(blocks)
    dense = shape_records(fit_records.records, capacity_ampere_hour=capacity)
    if dense and (basis["borrowed_from"] or curve["branches"] == "rests"):
        shared, words = _with_own_shape(shared, dense, blocks, settings)
        data = shared.data
        notes.append(words)
    entries, scores = {}, {}
    for name in members:
        try:
            member = member_named(name)
            of_series = {} if member.pairs is None else {"limits_second": None, "series": None}
            fitted = identify_condition(
                data, member, shared=shared, **(fixed | of_series), **settings
            )
            scores[name] = left_out(fitted, block)
        except Refusal as refusal:
            notes.append(f"{name} not identified at {fit_records.celsius:g} °C: {refusal}")
            continue
        tests = [record.test for record in fit_records.records]
        entry = condition_entry(
            fitted.condition, ambient_temperature_celsius=fit_records.celsius, tests=tests
        )
        entries[name] = entry | {
            "activation_energy_joule_per_mole": energy,
            "activation_energy_kelvin": float(max(np.ptp(r.celsius) for r in fit_records.records)),
        }
    table = _table(fit_records.celsius, data, curve)
    fitted = tuple(fit_records.records), data.records, blocks
    return Identified(table, entries, scores, notes, data.counted_std, fitted)


def _with_bound_hysteresis(shared, basis, fixed, settings):
    """Shared of data with the largest hysteresis that slow tests allow, and where it is from."""
    celsius, data, unknown = settings["celsius"], shared.data, ""
    try:
        plain = identify_condition(data, member_named("DRT"), shared=shared, **fixed, **settings)
        prompt_ohm = prompt_resistance(plain.condition)
    except Refusal as refusal:
        prompt_ohm, unknown = 0.0, say("model.no_drop", refusal=refusal)
    most_volt, words = largest_hysteresis(basis, celsius, data.knots, prompt_ohm=prompt_ohm)
    # What was searched so far holds no hysteresis, and stays.
    bounded = shared._replace(data=data._replace(most_volt=most_volt))
    return bounded, say("model.hysteresis", celsius=celsius, words=words, unknown=unknown)


def _with_own_shape(shared, dense, blocks, settings):
    """Shared of data with the OCV of the cell's own long loads, where other records speak for it.

    A circuit without hysteresis or kinetics takes some of these for OCV; what the long loads gain
    then is lost elsewhere. So blocks of the other records, each left out of the fit, have to be
    predicted better: in the mean of the logarithms by two standard errors, and as a whole.
    """
    data, names = shared.data, {record.test for record in dense}
    plain, block = member_named("DRT"), np.concatenate(blocks)
    others = [
        b for r, b in zip(data.records, blocks, strict=True) if r.test not in names and len(b)
    ]
    listed = ", ".join(sorted(names))
    if not others:
        return shared, f"OCV between the rests not from {listed}: no other record to prove it by"
    given = identify_condition(data, plain, shared=shared, **settings)
    shaped = data._replace(ocv_volt=ocv_from_loads(data, dense, held=given.held))
    of_shaped = shared_of(shaped)
    own = identify_condition(shaped, plain, shared=of_shaped, **settings)
    of_proof = np.isin(np.unique(block), np.concatenate(others))
    before, after = (left_out(fit, block).square_volt2[of_proof] for fit in (given, own))
    sure = compare(-np.log(after), -np.log(before)).z > SURE
    better = sure and after.mean() < before.mean()
    volts = " to ".join(f"{1e3 * np.sqrt(s.mean()):.2g}" for s in (before, after))
    words = f"from {listed}: blocks of other records left out of the fit {volts} mV"
    if not better:
        return shared, f"OCV between the rests not {words}"
    return of_shaped, f"OCV between the rests {words}"


def _table(celsius, data, curve):
    return {
        "ambient_temperature_celsius": celsius,
        "test": curve["test"],
        "branches": curve["branches"],
        "soc": GRID.tolist(),
        "ocv_volt": data.ocv_volt.tolist(),
    }


def _with_temperature(curves):
    """OCV tables with a temperature each: 25 °C where the sheet states none."""
    stated = "ambient_temperature_celsius"
    return [c | {stated: stated_or_reference(c[stated])} for c in curves]


def _nearest(curves, celsius):
    return min(
        _with_temperature(curves), key=lambda c: abs(c["ambient_temperature_celsius"] - celsius)
    )
