"""A cell with known parameters, its drives and pulses: what the tests of the models recover."""

import numpy as np

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import KINDS, rc_circuit

CAPACITY_AMPERE_HOUR = 2.0
KNOTS = np.linspace(0.1, 0.9, 5)
R0 = np.array([0.040, 0.034, 0.030, 0.029, 0.031])
R = np.array([[0.020, 0.012, 0.010, 0.011, 0.013], [0.030, 0.020, 0.018, 0.017, 0.020]])
TAU = np.array([8.0, 150.0])
OCV_SOC = np.linspace(0, 1, 101)
OCV_VOLT = 3.2 + 0.8 * OCV_SOC + 0.1 * np.sin(6 * OCV_SOC)


def soc_of(time, current, start=1.0):
    moved = np.diff(time) * (current[1:] + current[:-1]) / 7200
    return start + np.concatenate([[0.0], np.cumsum(moved)]) / CAPACITY_AMPERE_HOUR


def drive(rng, seconds=8000):
    """A random staircase of discharge and charge from 95 to about 10 %, with 5 min rests."""
    time = np.arange(float(seconds))
    steps = rng.uniform(-3.0, 1.1, size=seconds // 20 + 1)
    current = np.repeat(steps, 20)[:seconds]
    current[(time % 1500) >= 1200] = 0.0
    return time, current


def ocv_at(soc):
    return np.interp(soc, OCV_SOC, OCV_VOLT)


def voltage(time, current, soc, shift=0.0, hold="first_order", extra=(), resistance_factor=1.0):
    """Terminal voltage of the true cell, with any further branches beside its own.

    resistance_factor : of all resistances, scalar or (n,), or (1 + pairs, 1) of each, R0 first.
    """
    factors = np.broadcast_to(resistance_factor, (1 + len(R), len(soc)))
    pairs = zip(factors, (R0, *R), strict=True)
    at = [factor * np.interp(soc, KNOTS, values) for factor, values in pairs]
    circuit = (*rc_circuit(at[0], at[1:], TAU), *extra)
    settings = {"hold": hold, "open_circuit": (ocv_at, soc)}
    return simulate(circuit, time, current, ocv_at(soc) + shift, **settings)


def model(name="A", celsius=25.0, scale=1.0):
    """The true cell as a model file."""
    branches = [
        {"r_ohm": (scale * r).tolist(), "tau_second": [float(t)] * len(KNOTS)}
        for r, t in zip(R, TAU, strict=True)
    ]
    entry = {"soc": KNOTS.tolist(), "r0_ohm": (scale * R0).tolist(), "branches": branches}
    ocv = {"soc": OCV_SOC.tolist(), "ocv_volt": OCV_VOLT.tolist()}
    return {
        "schema": "cellwright-model/1",
        "cell": name,
        "capacity_ampere_hour": CAPACITY_AMPERE_HOUR,
        "ocv": [ocv | {"ambient_temperature_celsius": celsius}],
        "members": [
            {"model": "2RC", "conditions": [entry | {"ambient_temperature_celsius": celsius}]}
        ],
        "chosen": "2RC",
        "notes": [],
    }


# One value of every parameter that a branch may have.
VALUES = {
    "r_ohm": 0.02,
    "tau_second": 40.0,
    "r_charge_ohm": 0.02,
    "r_discharge_ohm": 0.03,
    "scale_volt": 0.05,
    "m_volt": 0.01,
    "charge_ampere_hour": 0.1,
    "soc_per_ampere": 0.004,
    "exchange_ampere": 0.8,
    "charge_coefficient": 0.5,
}


def stated(**changes):
    """The true cell's model, which says how well it fits."""
    document = model(**changes)
    for entry in document["members"][0]["conditions"]:
        entry["fit_rmse_volt"] = 0.01
    return document


def with_branch(kind):
    """The true cell with one further branch of a kind."""
    document = stated()
    knots = len(KNOTS)
    more = {name: [VALUES[name]] * knots for name in KINDS[kind].parameters}
    document["members"][0]["conditions"][0]["branches"].append({"kind": kind} | more)
    return document
