"""Laws over temperature, tested by predicting a temperature that was left out of the model.

1. All tests at a temperature are taken away, its OCV curve with them, and the chosen member of the
family is identified anew from the rest. 2. Each law over temperature predicts the tests
that had been fitted there; the best over the inner temperatures and the best over the two at the
edge are the ones that the cell's model keeps. 3. With them the tests for validation are predicted:
they chose nothing.
"""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import (
    BEYOND_KELVIN,
    circuit_at,
    member_of,
    open_circuit_volt,
)
from cellwright.circuits.temperature import LAW_IN_WORDS, LAWS, Laws, celsius_of
from cellwright.identification.cell import identify
from cellwright.identification.intervals import simulated
from cellwright.identification.validation import is_inner
from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.conditions import same_temperature
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()
SMALLEST_VOLT = 1e-6


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


def compare_temperature_laws(
    cell, whole, reduced, tests, *, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] of each law over temperature at temperatures left out of the fit, the best chosen.

    whole : the model of all temperatures. reduced : temperature [°C] → model without it.

    Returns rows, one a test and law: errors [V], chosen. Raises Refusal: nothing was predicted.
    Source: docs/temperature.md.
    """
    whole = given.model(whole)
    models = {celsius: given.model(model) for celsius, model in reduced.items()}
    measured = (inputs.cell_facts(cell), inputs.tests(tests))
    rows, notes = predicted(whole, models, *measured, split_rest_second=split_rest_second)
    # Beyond the tests a law by which resistance rises with temperature again is not offered.
    offered, refused = laws_beyond(whole)
    laws, words = choose_laws(rows, beyond=offered)
    marked = [row | {"chosen": row["law"] == laws[row["beyond"]]} for row in rows]
    notes = (words, *filter(None, [refused]), *notes)
    return Result({"rows": marked}, notes=notes)


def predict_left_out(
    cell, whole, reduced, laws, tests, *, split_rest_second=MODELS.split_rest_second
):
    """Errors [V] on validation tests at temperatures that the predicting model was not fitted to.

    whole, reduced : as of `compare_temperature_laws`. laws : its result, which law is kept.
    tests : for validation.

    Returns rows, one a test: errors [V]. Source: docs/temperature.md.
    """
    rows, notes = predicted(
        given.model(whole),
        {celsius: given.model(model) for celsius, model in reduced.items()},
        inputs.cell_facts(cell),
        inputs.tests(tests),
        laws=laws_kept(inputs.rows(laws)),
        # Validation tests, which took part neither in the fits nor in the choice of the law.
        proof=True,
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


def with_laws(model, laws):
    """A model whose resistances follow laws over temperature, in every member of the family.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. laws : temperature.Laws.
    """
    entry = {"resistance_laws": laws._asdict()}
    members = [
        member | {"conditions": [condition | entry for condition in member["conditions"]]}
        for member in model["members"]
    ]
    return model | {"members": members}


def predicted(whole, reduced, cell, tests, *, laws=None, proof=False, split_rest_second):
    """Errors of models with and without a temperature in their fit, by law over temperature.

    Parameters
    ----------
    whole : dict of the model of all temperatures. reduced : dict temperature [degC] → model
        identified without it.
    cell : CellFacts. tests : list of MeasuredTest, any temperature.
    laws : temperature.Laws that are asked, or None: all are tried.
    proof : score what took no part in fits (roles validation, split), else what did (fit, split).
    split_rest_second : shortest rest that cuts a test of role `split` [s].

    Returns
    -------
    rows : list of dict: left_out_celsius, predicted_test, law, model, beyond (an edge of the range
        was left out, the law goes beyond what is known), rmse_volt, rmse_volt_soc_5_95,
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
            rows += _rows(celsius, (whole, reduced[celsius]), cell, test, laws, settings)
        except Refusal as refusal:
            notes.append(f"not predicted: {test.facts.test}: {refusal}")
    return rows, notes


def _rows(celsius, models, cell, test, laws, settings):
    """Rows of one test, one per law; the errors of the whole model are the same in each."""
    whole, reduced = models
    temperatures = [c["ambient_temperature_celsius"] for c in reduced["members"][0]["conditions"]]
    beyond = not min(temperatures) - BEYOND_KELVIN < celsius < max(temperatures) + BEYOND_KELVIN
    tried = LAWS if laws is None else [laws.beyond if beyond else laws.inside]
    # Each model has its own OCV, and so its own SoC at the start; a law changes neither.
    known, unknown = (laid_out(test, model, cell, **settings) for model in models)
    name = whole["chosen"]
    own_volt, own_inner_volt, _ = _errors(whole, name, known)
    about = {
        "left_out_celsius": float(celsius),
        "predicted_test": test.facts.test,
        "model": name,
        "beyond": beyond,
    }
    rows = []
    for law in tried:
        followed = with_laws(reduced, Laws(law, law))
        volt, inner_volt, extrapolated = _errors(followed, name, unknown)
        rows.append(
            about
            | {
                "law": law,
                "rmse_volt": volt,
                "rmse_volt_soc_5_95": inner_volt,
                "own_rmse_volt": own_volt,
                "own_rmse_volt_soc_5_95": own_inner_volt,
                "ratio": inner_volt / own_inner_volt,
                "extrapolated": extrapolated,
            }
        )
    return rows


def choose_laws(rows, *, beyond=LAWS):
    """The laws with the smallest mean logarithm of the error, inside the range and beyond it.

    Inside the range "arrhenius" and "between" are one.

    Parameters
    ----------
    rows : list of dict, from `predicted` with the tests that may be fitted.
    beyond : names of the laws that may go on beyond the tested temperatures; see
        `laws_beyond`.

    Returns
    -------
    laws : temperature.Laws; "between" for what no temperature was left out of. words : a sentence
        with their errors.

    Raises
    ------
    Refusal : nothing was predicted.
    """
    if not rows:
        raise Refusal("no temperature could be left out and predicted")
    typical = [
        _typical([row for row in rows if row["beyond"] is is_beyond]) for is_beyond in (False, True)
    ]
    offered = [
        {k: v for k, v in errors.items() if k in names}
        for errors, names in zip(typical, (LAWS, beyond), strict=True)
    ]
    laws = Laws(*(min(errors, key=errors.get, default=LAWS[0]) for errors in offered))
    listed = [
        f"{place} those tested by {LAW_IN_WORDS[law]}: typical error at a temperature left out "
        + ", ".join(f"{LAW_IN_WORDS[name]} {1e3 * volt:.3g} mV" for name, volt in errors.items())
        for place, law, errors in zip(("between", "beyond"), laws, typical, strict=True)
        if errors
    ]
    return laws, "resistance at other temperatures: " + "; ".join(listed)


def _typical(rows):
    """Geometric mean of each law's error [V], rounded to 0.1 µV so that equal errors compare."""
    logs = {
        name: [np.log(max(row["rmse_volt"], SMALLEST_VOLT)) for row in rows if row["law"] == name]
        for name in LAWS
    }
    return {name: round(float(np.exp(np.mean(some))), 7) for name, some in logs.items() if some}


def laws_kept(tried):
    """The laws that are marked as chosen in a table of tried ones.

    Parameters
    ----------
    tried : list of dict, rows of `predicted` with `chosen`.

    Returns
    -------
    laws : temperature.Laws.
    """
    chosen = {row["beyond"]: row["law"] for row in tried if row["chosen"]}
    return Laws(chosen.get(False, LAWS[0]), chosen.get(True, LAWS[0]))


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
ORIGINS = {"R": "r_ohmic_ohm", "kinetic": "r_kinetic_ohm"}  # every other resistance relaxes
RELAXING = "r_relaxing_ohm"
KINDS = {"r_ohmic_ohm": "ohmic", "r_kinetic_ohm": "kinetic", RELAXING: "relaxing"}


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


def laws_beyond(model):
    """Laws over temperature that may go on beyond the temperatures a model was identified at.

    A parabola through the logarithms of resistances turns somewhere. It is not offered where a
    sum of resistances of one kind then rises with temperature, at any SoC within the 10 K that
    `temperature_table` goes on for, and held to the slope of the last two temperatures does not.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, identified at all its temperatures.

    Returns
    -------
    offered : tuple of names of `temperature.LAWS`.
    words : str, which is not offered and why, or "".
    """
    rising = {name: _rising(with_laws(model, Laws(beyond=name))) for name in LAWS}
    turned = {name: sorted(places - rising[LAWS[0]]) for name, places in rising.items()}
    offered = tuple(name for name in LAWS if not turned[name])
    words = [
        f"{name} is not offered beyond the tested temperatures: by it the {KINDS[kind]} resistance "
        f"at {100 * soc:.0f} % SoC would rise with temperature at {celsius:g} °C"
        for name, ((celsius, kind, soc), *_) in ((n, t) for n, t in turned.items() if t)
    ]
    return offered, "; ".join(words)


def _rising(model):
    """Set of (temperature, kind, SoC) beyond the tested range where resistance rises with it."""
    table = temperature_table(model, None, step_kelvin=1.0)
    celsius = np.unique(table["temperature_celsius"])
    outside = table["extrapolated_temperature"].reshape(len(celsius), -1)[:, 0]
    places = set()
    for kind in KINDS:
        rises = np.diff(table[kind].reshape(len(celsius), -1), axis=0) > 0
        rises &= (outside[1:] | outside[:-1])[:, None]
        places |= {(celsius[k], kind, SOC[s]) for k, s in np.argwhere(rises)}
    return places


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
    sums = {name: np.zeros(len(SOC)) for name in (*ORIGINS.values(), RELAXING)}
    for branch in sampled.circuit:
        sums[ORIGINS.get(branch.kind, RELAXING)] += branch.parameters.get("r_ohm", 0.0)
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
