"""Does a model that knows other temperatures predict this one? Laws compared, then what they say.

1. All tests at a temperature are taken away, its OCV curve with them, and the chosen member of the
family is identified anew from the rest. 2. Each law over temperature (`tables.LAWS`) predicts the
tests that had been fitted there; over all temperatures the best of them is the one the cell's model
keeps. 3. With that law the tests for validation are predicted: they chose nothing.
"""

from typing import NamedTuple

import numpy as np

from cellwright.models.basis import soc_of
from cellwright.models.groups import SAME_CELSIUS, course_celsius
from cellwright.models.lookup import SAME_KELVIN, simulate_model
from cellwright.models.split import fit_mask
from cellwright.models.tables import LAWS
from cellwright.refusal import Refusal
from cellwright.series.anchor import REST_C_RATE

SMALLEST_VOLT = 1e-6


class Reduced(NamedTuple):
    """What is left without a temperature: basis and tests as `cell.cell_model` takes them."""

    basis: dict
    tests: list


def without(basis, tests, *, celsius):
    """Take the tests and the OCV curve of one temperature away.

    Parameters
    ----------
    basis : dict, from `basis.basis`. tests : list of cell.FitTest.
    celsius : the temperature to leave out [degC]; what lies within 2 °C goes with it.

    Returns
    -------
    reduced : Reduced. The only OCV curve stays: nothing could be predicted without one. Capacity,
        which defines the SoC, stays as well.

    Raises
    ------
    Refusal : no test is left.
    """
    kept = [test for test in tests if not _near(test.facts, celsius)]
    if not kept:
        raise Refusal(f"no test is left without those at {celsius:g} °C")
    curves = [curve for curve in basis["ocv"] if not _near(curve, celsius)]
    return Reduced(basis | {"ocv": curves or basis["ocv"]}, kept)


def with_law(model, law):
    """A model whose resistances follow a law over temperature, in every member of the family.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. law : one of `tables.LAWS`.
    """
    members = [
        member | {"conditions": [c | {"resistance_law": law} for c in member["conditions"]]}
        for member in model["members"]
    ]
    return model | {"members": members}


def predicted(whole, reduced, cell, tests, *, laws=LAWS, proof=False, split_rest_second):
    """Errors of a model that knows a temperature beside those of one that does not, by law.

    Parameters
    ----------
    whole : dict of the model of all temperatures. reduced : dict temperature [degC] → model
        identified without it.
    cell : dict, the cell's row. tests : list of cell.FitTest, any temperature.
    laws : which are tried.
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
    settings = {"name": whole["chosen"], "proof": proof, "split_rest_second": split_rest_second}
    there = [(t, test) for t in reduced for test in tests if _near(test.facts, t)]
    for celsius, test in there:
        try:
            rows += _rows(celsius, (whole, reduced[celsius]), cell, test, laws, settings)
        except Refusal as refusal:
            notes.append(f"not predicted: {test.facts['test']}: {refusal}")
    return rows, notes


def _rows(celsius, models, cell, test, laws, settings):
    """One row a law; the model that knows the temperature is the same beside all of them."""
    whole, other = models
    own = _errors(whole, cell, test, **settings)
    found = [_errors(with_law(other, law), cell, test, **settings) for law in laws]
    about = {
        "left_out_celsius": float(celsius),
        "predicted_test": test.facts["test"],
        "model": settings["name"],
        "beyond": _beyond(other, celsius),
    }
    return [about | _compared(law, one, own) for law, one in zip(laws, found, strict=True)]


class LawChoice(NamedTuple):
    """The law that predicts left-out temperatures best, what each errs by [V], and in words."""

    law: str
    typical_volt: dict
    words: str


def choose_law(rows):
    """The law with the smallest mean logarithm of the error over temperatures left out.

    Inside the range "arrhenius" and "between" are one: they differ where the edges were left out.

    Parameters
    ----------
    rows : list of dict, from `predicted` with the tests that may be fitted.

    Returns
    -------
    choice : LawChoice.

    Raises
    ------
    Refusal : nothing was predicted.
    """
    if not rows:
        raise Refusal("no temperature could be left out and predicted")
    typical = {
        law: float(np.exp(np.mean([_log(row["rmse_volt"]) for row in rows if row["law"] == law])))
        for law in LAWS
    }
    best = min(typical, key=typical.get)
    listed = ", ".join(f"{law} {1e3 * volt:.3g} mV" for law, volt in typical.items())
    words = f"resistance over temperature by {best!r}: typical error at a temperature left out: "
    return LawChoice(best, typical, words + listed)


class Errors(NamedTuple):
    """RMS of a simulation, all of it and SoC 5–95 % [V], and the share beyond what is known."""

    rmse_volt: float
    inner_volt: float
    extrapolated: float


def _errors(model, cell, test, *, name, proof, split_rest_second):
    facts, series = test
    time, current = series["test_time_second"], series["current_ampere"]
    soc = soc_of(series, model, facts, cell).soc
    celsius, _ = course_celsius(facts, series)
    run = simulate_model(model, name, time, current, soc, celsius, kind=facts.get("kind"))
    used = np.ones(len(time), bool)
    if facts["role"] == "split":
        rest = REST_C_RATE * model["capacity_ampere_hour"]
        used = fit_mask(time, current, rest_second=split_rest_second, rest_ampere=rest) ^ proof
    error = series["voltage_volt"] - run.voltage_volt
    outside = (run.extrapolated | run.outside_temperature)[used]
    inner = used & (soc >= 0.05) & (soc <= 0.95)
    return Errors(_rms(error[used]), _rms(error[inner]), float(outside.mean()))


def _compared(law, other, own):
    return {
        "law": law,
        "rmse_volt": other.rmse_volt,
        "rmse_volt_soc_5_95": other.inner_volt,
        "own_rmse_volt": own.rmse_volt,
        "own_rmse_volt_soc_5_95": own.inner_volt,
        "ratio": other.inner_volt / own.inner_volt,
        "extrapolated": other.extrapolated,
    }


def _beyond(reduced, celsius):
    known = [c["ambient_temperature_celsius"] for c in reduced["members"][0]["conditions"]]
    return not min(known) - SAME_KELVIN < celsius < max(known) + SAME_KELVIN


def _near(facts, celsius):
    stated = facts["ambient_temperature_celsius"]
    return stated is not None and abs(stated - celsius) <= SAME_CELSIUS


def _rms(error):
    return float(np.sqrt(np.mean(error**2))) if len(error) else np.nan


def _log(volt):
    return np.log(max(volt, SMALLEST_VOLT))
