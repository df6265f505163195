"""A cell exported by the pipeline as a PyBaMM model; needs pybamm and nothing of ours.

A circuit becomes PyBaMM's Thevenin model; `P`, one particle with charge transfer, a model of its
own, on one sphere that PyBaMM discretises.

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
ZERO_CELSIUS_KELVIN, GAS_CONSTANT, FARADAY = 273.15, 8.314462618, 96485.33212


def load(path, *, member: str | None = None, celsius: float) -> dict:
    """Tables of one model at one of its temperatures; of `P`, which knows all, at any.

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
    if "shell_faces" in tables[0]:
        return tables[0] | {"temperature_celsius": celsius}
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
    """PyBaMM's model of a cell and its parameter values, but for current and initial SoC.

    The cell stays at the temperature of its tables: they do not depend on PyBaMM's thermal state,
    whose parameters keep PyBaMM's defaults. The voltage cut-offs are opened wide.
    """
    if "shell_faces" in tables:
        return Particle(tables), pybamm.ParameterValues(
            {"Cell capacity [A.h]": tables["capacity_ampere_hour"]}
        )
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


class Particle(pybamm.BaseModel):
    """One particle with charge transfer, formulas in docs/models.md.

    z diffuses in a sphere, u is the overvoltage at its surface, fast and slow are lags of the
    current, positive on charge.
    """

    def __init__(self, tables: dict):
        super().__init__("One particle with charge transfer")
        self.tables = tables
        self.radius = pybamm.SpatialVariable(
            "r_n", domain="negative particle", coord_sys="spherical polar"
        )
        celsius, numbers = tables["temperature_celsius"], tables["numbers"]
        missing, stretch = (self._over_temperature(tables[n]) for n in ("missing", "stretch"))
        capacity = pybamm.Parameter("Cell capacity [A.h]")
        start = pybamm.Parameter("Initial SoC")
        discharge = pybamm.FunctionParameter("Current function [A]", {"Time [s]": pybamm.t})
        current = -discharge
        soc = pybamm.Variable("SoC")
        z = pybamm.Variable("SoC in the particle", domain="negative particle")
        u = pybamm.Variable("Overvoltage of charge transfer [V]")
        rate = self._at("diffusion", "_per_second", z, energy=-1.0)
        flux = current * (1.0 + stretch) / (3.0 * 3600.0 * capacity)
        self.rhs = {soc: current / (3600.0 * capacity), z: pybamm.div(rate * pybamm.grad(z))}
        self.initial_conditions = {soc: start, z: 1.0 - missing - (1.0 - start) * (1.0 + stretch)}
        edge = (flux / pybamm.surf(rate), "Neumann")
        self.boundary_conditions = {z: {"left": (pybamm.Scalar(0.0), "Neumann"), "right": edge}}
        surface = pybamm.surf(z)
        kelvin = celsius + ZERO_CELSIUS_KELVIN
        scale = numbers["transfer_scale"] * GAS_CONSTANT * kelvin / FARADAY
        through = scale / self._at("transfer", "_ohm", surface) * pybamm.sinh(u / scale)
        self.rhs[u] = (current - through) / self._at("double_layer", "_farad")
        self.initial_conditions[u] = 0.0
        volt = self._ocv(surface) + self._at("r0", "_ohm", surface) * current + u
        volt += self._direction(current / (3600.0 * capacity)) * self._course(
            "hysteresis_volt", surface
        )
        for name in ("fast", "slow"):
            lag = pybamm.Variable(f"{name.capitalize()} lag of the current [A]")
            constant = numbers[f"{name}_second"] * np.exp(
                numbers[f"{name}_second_joule_per_mole"] * self._warmth() / GAS_CONSTANT
            )
            self.rhs[lag] = (current - lag) / constant
            self.initial_conditions[lag] = 0.0
            volt = volt + self._at(name, "_ohm", surface) * lag
        self.variables = {
            "Voltage [V]": volt,
            "Current [A]": discharge,
            "SoC": soc,
            "SoC at the surface": surface,
            "Overvoltage of charge transfer [V]": u,
            "Time [s]": pybamm.t,
        }

    def _direction(self, soc_per_second):
        """State of the hysteresis, -1 to 1: the mean of stops, which the charge moves to an end."""
        stops = []
        for width in self.tables["stop_widths"]:
            stop = pybamm.Variable(f"Stop of a width of {width:.5f}")
            move = soc_per_second / width
            held = (stop >= 1.0) * (move > 0.0) + (stop <= -1.0) * (move < 0.0)
            self.rhs[stop] = move * (1.0 - held)
            self.initial_conditions[stop] = 0.0
            stops.append(stop)
        return sum(stops) / len(stops)

    def _warmth(self, celsius=None):
        celsius = self.tables["temperature_celsius"] if celsius is None else celsius
        reference = self.tables["reference_celsius"] + ZERO_CELSIUS_KELVIN
        return 1.0 / (celsius + ZERO_CELSIUS_KELVIN) - 1.0 / reference

    def _over_temperature(self, values):
        """A number of each temperature at that of the cell: straight over 1/T, flat beyond."""
        known = [-1.0 / (celsius + ZERO_CELSIUS_KELVIN) for celsius in self.tables["celsius"]]
        here = -1.0 / (self.tables["temperature_celsius"] + ZERO_CELSIUS_KELVIN)
        return float(np.interp(here, known, values))

    def _course(self, name, soc):
        """A course over SoC, straight between its knots and flat beyond, and whether it is of the
        logarithm."""
        course = self.tables["courses"][name]
        knots, values = np.array(course["soc"]), np.array(course["value"])
        values = np.log(values) if course["logarithmic"] else values
        inside = pybamm.minimum(pybamm.maximum(soc, knots[0]), knots[-1])
        value = pybamm.Interpolant(knots, values, inside)
        return pybamm.exp(value) if course["logarithmic"] else value

    def _at(self, name, unit, soc=None, energy=1.0):
        """A rate, resistance or capacitance by its Arrhenius law, which may bend in the cold."""
        numbers, warmth = self.tables["numbers"], self._warmth()
        value = numbers[name + unit] if soc is None else self._course(name + unit, soc)
        bend = numbers.get(f"{name}_bend_joule_per_mole", 0.0)
        bent = bend * warmth**2 / self._warmth(self.tables["bend_celsius"])
        joule = energy * numbers[f"{name}_joule_per_mole"] * warmth + bent
        return value * np.exp(joule / GAS_CONSTANT)

    def _ocv(self, soc):
        warmer = self.tables["temperature_celsius"] - self.tables["reference_celsius"]
        rest = self._course("ocv_shift_volt", soc)
        rest += warmer * self._course("ocv_volt_per_kelvin", soc)
        return _table(self.tables, self.tables["ocv_volt"], soc) + rest

    @property
    def default_geometry(self):
        return {"negative particle": {self.radius: {"min": 0.0, "max": 1.0}}}

    @property
    def default_var_pts(self):
        return {self.radius: len(self.tables["shell_faces"]) - 1}

    @property
    def default_submesh_types(self):
        """The shells that the cell was fitted with: finer ones are another model in the cold."""
        faces = {"edges": np.array(self.tables["shell_faces"])}
        shells = pybamm.MeshGenerator(pybamm.UserSupplied1DSubMesh, submesh_params=faces)
        return {"negative particle": shells}

    @property
    def default_spatial_methods(self):
        surface = {"use bcs": True, "order": {"gradient": "linear", "value": "linear"}}
        return {"negative particle": pybamm.FiniteVolume({"extrapolation": surface})}

    @property
    def default_solver(self):
        return pybamm.IDAKLUSolver(rtol=1e-6, atol=1e-7)
