"""The law over temperature, tested by predicting a temperature that was left out of the model.

All tests at a temperature are taken away, its OCV curve with them, and the chosen member of the
family is identified anew from the rest. It predicts the tests that had been fitted there, which
tells how far the model reaches, and the tests for validation.
"""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import (
    BEYOND_KELVIN,
    circuit_at,
    member_of,
    open_circuit_volt,
)
from cellwright.circuits.temperature import (
    ENERGIES,
    celsius_of,
    coldest_first,
    kind_of_resistance,
    laws_over_temperature,
)
from cellwright.identification.cell import identify
from cellwright.identification.intervals import simulated
from cellwright.identification.messages import say
from cellwright.identification.validation import is_inner
from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.conditions import same_temperature
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()


def identify_without(
    cell, whole, basis, tests, *, celsius, split_rest_second=MODELS.split_rest_second
):
    """The chosen member of a model, identified without the tests of one temperature.

    whole : the model of all temperatures.
    celsius : temperature that is left out [°C].

    Returns as `identify`. Raises Refusal: no test is left, or none that can be fitted.
    Source: docs/temperature.md.
    """
    # Its OCV at that temperature goes too: it would tell what is to be predicted.
    rest = without(inputs.basis(basis), inputs.tests(tests), celsius=celsius)
    # Other members would cost as much time and are not used.
    content = given.model(whole)
    members = [content["chosen"]]
    found = identify(cell, *rest, members=members, split_rest_second=split_rest_second)
    # Told apart from the notes of the model of all temperatures, where numbers differ.
    of_all, without_it = set(content["notes"]), f"fitted without the tests at {celsius:g} °C"
    notes = (note if note in of_all else f"{without_it}: {note}" for note in found.notes)
    return found._replace(notes=tuple(notes))


def predict_left_out(
    cell, whole, reduced, tests, *, validation=True, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] of a model at temperatures that it was not fitted to.

    whole : the model of all temperatures. reduced : temperature [°C] → model without it.
    validation : whether tests are those for validation, else those that are fitted.

    Returns rows, one a test: errors [V]. Source: docs/temperature.md.
    """
    rows, notes = predicted(
        given.model(whole),
        {celsius: given.model(model) for celsius, model in reduced.items()},
        inputs.cell_facts(cell),
        inputs.tests(tests),
        proof=validation,
        split_rest_second=split_rest_second,
    )
    return Result({"rows": rows}, notes=tuple(notes))


def without(basis, tests, *, celsius):
    """Basis and tests of a cell without those of one temperature.

    Parameters
    ----------
    basis : dict, from `basis.basis`. tests : list of MeasuredTest.
    celsius : the temperature to leave out [degC]; tests of one temperature go with it.

    Returns
    -------
    basis, tests : the same. The only OCV curve stays: nothing could be predicted without one.
        Capacity, which defines the SoC, stays as well.

    Raises
    ------
    Refusal : no test is left.
    """
    remaining = [t for t in tests if not _near(t.facts.ambient_temperature_celsius, celsius)]
    if not remaining:
        raise Refusal(f"no test is left without those at {celsius:g} °C")
    stated = "ambient_temperature_celsius"
    curves = [curve for curve in basis["ocv"] if not _near(curve[stated], celsius)]
    return basis | {"ocv": curves or basis["ocv"]}, remaining


def with_laws(model, left_out=()):
    """A model that states its laws over temperature, and how it errs where one was left out.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. left_out : rows of `predicted` on fitted tests.

    Returns
    -------
    model : the same with `laws_over_temperature` in each member, as all that simulates it takes
        them, and `left_out_temperatures`: of each its RMS error [V] at SoC 5 to 95 %, the mean of
        its tests that have rows there, without and with it in the fit.
    """
    members = [
        member
        | {
            "laws_over_temperature": [
                law._asdict() | {"kinds": list(law.kinds)}
                for law in laws_over_temperature(coldest_first(member["conditions"])[0])
            ]
        }
        for member in model["members"]
    ]
    names = ("rmse_volt_soc_5_95", "own_rmse_volt_soc_5_95")
    errors, words = [], []
    known = [row for row in left_out if np.isfinite([row[name] for name in names]).all()]
    for celsius in sorted({row["left_out_celsius"] for row in known}):
        of_it = [row for row in known if row["left_out_celsius"] == celsius]
        volt = {name.removesuffix("_soc_5_95"): rms([row[name] for row in of_it]) for name in names}
        about = {"ambient_temperature_celsius": celsius, "beyond": of_it[0]["beyond"]}
        errors.append(about | {"model": of_it[0]["model"]} | volt)
        without_mv, own_mv = (1e3 * value for value in volt.values())
        fields = {"celsius": celsius, "without_mv": without_mv, "own_mv": own_mv}
        words.append(say("model.left_out_celsius", **fields))
    said = [say("model.left_out_temperatures", listed=", ".join(words))] if words else []
    notes = [*model.get("notes", ()), *said]
    return model | {"members": members, "left_out_temperatures": errors, "notes": notes}


def predicted(whole, reduced, cell, tests, *, proof=False, split_rest_second):
    """Errors of models with and without a temperature in their fit.

    Parameters
    ----------
    whole : dict of the model of all temperatures. reduced : dict temperature [degC] → model
        identified without it.
    cell : CellFacts. tests : list of MeasuredTest, any temperature.
    proof : score what took no part in fits (roles validation, split), else what did (fit, split).
    split_rest_second : shortest rest that cuts a test of role `split` [s].

    Returns
    -------
    rows : list of dict: left_out_celsius, predicted_test, model, beyond (an edge of the range was
        left out, the law goes beyond what is known), rmse_volt, rmse_volt_soc_5_95,
        own_rmse_volt, own_rmse_volt_soc_5_95 of the model that knows the temperature, ratio of the
        two over SoC 5–95 %, extrapolated (share of samples beyond what the reduced model knows).
    notes : list of sentences, why a test is not among them.
    """
    rows, notes = [], []
    settings = {"proof": proof, "split_rest_second": split_rest_second}
    pairs = [
        (t, test)
        for t in reduced
        for test in tests
        if _near(test.facts.ambient_temperature_celsius, t)
    ]
    for celsius, test in pairs:
        try:
            rows.append(_row(celsius, (whole, reduced[celsius]), cell, test, settings))
        except Refusal as refusal:
            notes.append(f"not predicted: {test.facts.test}: {refusal}")
    return rows, notes


def _row(celsius, models, cell, test, settings):
    """Row of one test."""
    whole, reduced = models
    temperatures = [c["ambient_temperature_celsius"] for c in reduced["members"][0]["conditions"]]
    beyond = not min(temperatures) - BEYOND_KELVIN < celsius < max(temperatures) + BEYOND_KELVIN
    # Each model has its own OCV, and so its own SoC at the start.
    known, unknown = (laid_out(test, model, cell, **settings) for model in models)
    name = whole["chosen"]
    own_volt, own_inner_volt, _ = _errors(whole, name, known)
    volt, inner_volt, extrapolated = _errors(reduced, name, unknown)
    return {
        "left_out_celsius": float(celsius),
        "predicted_test": test.facts.test,
        "model": name,
        "beyond": beyond,
        "rmse_volt": volt,
        "rmse_volt_soc_5_95": inner_volt,
        "own_rmse_volt": own_volt,
        "own_rmse_volt_soc_5_95": own_inner_volt,
        "ratio": inner_volt / own_inner_volt,
        "extrapolated": extrapolated,
    }


def _errors(model, name, record):
    """RMS error of a simulation, over all rows and SoC 5–95 % [V], and the extrapolated share."""
    run = simulated(model, name, record)
    used = record.used
    error = record.voltage_volt - run.voltage_volt
    outside = (run.extrapolated | run.outside_temperature)[used]
    return rms(error[used]), rms(error[used & is_inner(record.soc)]), float(outside.mean())


def _near(stated, celsius):
    return stated is not None and same_temperature(stated, celsius)


SOC = np.linspace(0.0, 1.0, 21)


def temperature_table(model, member, *, step_kelvin=5.0):
    """Table of OCV and resistances of a member at, between and up to 10 K beyond its temperatures.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. member : name, or None for the chosen one.
    step_kelvin : of the grid, whose temperatures are multiples of it; the member's own are added.

    Returns
    -------
    columns : dict of model, temperature_celsius, soc, ocv_volt, r_ohmic_ohm, r_kinetic_ohm,
        r_relaxing_ohm (sums of the branches of a kind), extrapolated_temperature (beyond all
        temperatures that were tested), extrapolated_soc (outside the SoC that was identified). A
        model of one unknown temperature has that one, NaN.
    """
    entry = member_of(model, member)
    temperatures = sorted(celsius_of(c["ambient_temperature_celsius"]) for c in entry["conditions"])
    blocks = [
        _block(model, entry, celsius, temperatures)
        for celsius in _grid(temperatures, step_kelvin, 10.0)
    ]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _grid(temperatures, step, beyond):
    if np.isnan(temperatures).any():
        return [np.nan]
    low, high = (
        np.ceil((temperatures[0] - beyond) / step),
        np.floor((temperatures[-1] + beyond) / step),
    )
    return np.unique(np.concatenate([np.arange(low, high + 0.5) * step, temperatures]))


def _block(model, member, celsius, temperatures):
    sampled = circuit_at(member["conditions"], SOC, celsius)
    sums = {f"r_{kind}_ohm": np.zeros(len(SOC)) for kind in ENERGIES}
    for branch in sampled.circuit:
        sums[f"r_{kind_of_resistance(branch.kind)}_ohm"] += branch.parameters.get("r_ohm", 0.0)
    return {
        "model": np.full(len(SOC), member["model"]),
        "temperature_celsius": np.full(len(SOC), celsius),
        "soc": SOC,
        "ocv_volt": open_circuit_volt(model, sampled, celsius),
        **sums,
        "extrapolated_temperature": np.full(
            len(SOC), not temperatures[0] <= celsius <= temperatures[-1]
        ),
        "extrapolated_soc": sampled.outside_soc,
    }
