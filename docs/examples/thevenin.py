"""A cell exported by the pipeline as PyBaMM's Thevenin model; needs pybamm and nothing of ours.

from thevenin import load, thevenin
model, values = thevenin(load("results/models/C1/pybamm_thevenin.json", celsius=25))
values["Current function [A]"] = 2.9  # PyBaMM counts discharge positive
solution = pybamm.Simulation(model, parameter_values=values).solve([0, 1800])
"""

import json
import warnings
from pathlib import Path

import numpy as np
import pybamm

TINY_AMPERE = 1e-6  # smooths |I| at zero
TINY_OHM = 1e-9  # over which a capacitance is divided


def load(path, *, member: str | None = None, celsius: float) -> dict:
    """Tables of one model at one of its temperatures.

    Without a `member` it is the chosen one, or, where PyBaMM cannot run that, the one that the file
    names for it: a warning says so, and how well both do on tests that took no part in their fit.
    """
    document = json.loads(Path(path).read_text(encoding="utf-8"))
    name = member or document["exported"] or document["chosen"]
    if member is None and name != document["chosen"]:
        warnings.warn(_stands_in(document, name), stacklevel=2)
    if name in document["refused"]:
        raise ValueError(f"{name} was not exported: {document['refused'][name]}")
    tables = next(one["tables"] for one in document["members"] if one["model"] == name)
    by_temperature = {one["temperature_celsius"]: one for one in tables}
    if celsius not in by_temperature:
        raise ValueError(f"{name} is known at {sorted(by_temperature)} °C, not at {celsius}")
    return by_temperature[celsius]


def _stands_in(document: dict, name: str) -> str:
    """Which model stands for the chosen one, why, and the validation error of both."""
    chosen = document["chosen"]
    own = next(one["validation_rmse_volt"] for one in document["members"] if one["model"] == name)
    both = own, document["refused_validation_rmse_volt"][chosen]
    errors = "not validated"
    if None not in both:
        errors = "validation error {:.3g} mV against {:.3g} mV".format(
            *(1e3 * volt for volt in both)
        )
    return f"{name} in place of {chosen} ({errors}): {document['refused'][chosen]}"


def thevenin(tables: dict):
    """PyBaMM's Thevenin model and its parameter values, but for current and initial SoC.

    The cell stays at the temperature of its tables: they do not depend on PyBaMM's thermal state,
    whose parameters keep PyBaMM's defaults. The voltage cut-offs are opened wide.
    """
    resistors = [one for one in tables["elements"] if one["kind"] == "R_two_way"]
    pairs = [one for one in tables["elements"] if one["kind"] != "R_two_way"]
    # PyBaMM asks for one element at least: this one has no effect.
    points = len(tables["soc"])
    pairs = pairs or [{"kind": "RC", "r_ohm": [1e-12] * points, "tau_second": [1.0] * points}]
    model = pybamm.equivalent_circuit.Thevenin(options={"number of rc elements": len(pairs)})
    values = model.default_parameter_values
    celsius = tables["temperature_celsius"]
    kelvin = 273.15 + (25.0 if celsius is None else celsius)
    new = {
        "Cell capacity [A.h]": tables["capacity_ampere_hour"],
        "Nominal cell capacity [A.h]": tables["capacity_ampere_hour"],
        "Initial temperature [K]": kelvin,
        "Ambient temperature [K]": kelvin,
        "Entropic change [V/K]": 0.0,
        "Upper voltage cut-off [V]": 99.0,
        "Lower voltage cut-off [V]": -99.0,
        "Open-circuit voltage [V]": lambda soc: _table(tables, tables["ocv_volt"], soc),
        "R0 [Ohm]": _resistance(tables, resistors),
    }
    for k, one in enumerate(pairs, 1):
        r, c = ELEMENTS[one["kind"]](tables, one)
        new |= {f"R{k} [Ohm]": r, f"C{k} [F]": c}
        new[f"Element-{k} initial overpotential [V]"] = 0.0
    values.update(new, check_already_exists=False)
    return model, values


def _table(tables, values, soc):
    return pybamm.Interpolant(np.array(tables["soc"]), np.array(values), soc)


def _resistance(tables, two_way):
    def r0(_celsius, current, soc):
        total = _table(tables, tables["r0_ohm"], soc)
        for one in two_way:
            charge, discharge = (
                _table(tables, one[f"r_{way}_ohm"], soc) for way in ("charge", "discharge")
            )
            total = total + (current < 0) * charge + (current >= 0) * discharge
        return total

    return r0


def _rc(tables, one):
    def r(_celsius, _current, soc):
        return _table(tables, one["r_ohm"], soc)

    def c(_celsius, _current, soc):
        return _table(tables, one["tau_second"], soc) / _table(tables, one["r_ohm"], soc)

    return r, c


def _rc_two_way(tables, one):
    def r(_celsius, current, soc):
        charge, discharge = (
            _table(tables, one[f"r_{way}_ohm"], soc) for way in ("charge", "discharge")
        )
        return (current < 0) * charge + (current >= 0) * discharge + TINY_OHM

    def c(celsius, current, soc):
        return _table(tables, one["tau_second"], soc) / r(celsius, current, soc)

    return r, c


def _kinetic(tables, one):
    """R(I) = scale·asinh(r·I/scale)/I, smooth at zero."""

    def r(_celsius, current, soc):
        small, scale = (_table(tables, one[name], soc) for name in ("r_ohm", "scale_volt"))
        x = pybamm.sqrt((small * current / scale) ** 2 + 1e-16)
        return small * pybamm.arcsinh(x) / x

    def c(celsius, current, soc):
        return _table(tables, one["tau_second"], soc) / r(celsius, current, soc)

    return r, c


def _hysteresis(tables, one):
    """R = m/|I| and C = charge/m: goes to ±m, with the charge passed for its clock."""

    def r(_celsius, current, soc):
        return _table(tables, one["m_volt"], soc) / pybamm.sqrt(current**2 + TINY_AMPERE**2)

    def c(_celsius, _current, soc):
        coulomb = 3600.0 * _table(tables, one["charge_ampere_hour"], soc)
        return coulomb / _table(tables, one["m_volt"], soc)

    return r, c


ELEMENTS = {"RC": _rc, "RC_two_way": _rc_two_way, "kinetic": _kinetic, "hysteresis": _hysteresis}
