"""Cells in series with known parameters: models, and a laboratory's cells of the same numbers."""

import numpy as np

CELSIUS = 25.0
SOC = np.linspace(0.0, 1.0, 101)
OCV_VOLT = 3.0 + 0.25 * (1 - np.exp(-25 * SOC)) + 0.8 * SOC + 0.06 * np.sin(7 * SOC)
R_OHM, TAU_SECOND = (0.0012, 0.0015), (8.0, 120.0)
R0_OHM, FULL_AMPERE_HOUR = 0.0018, 30.0
LOWER_VOLT, UPPER_VOLT = 3.0, float(OCV_VOLT[-1])


def model(name, capacity_share=1.0, resistance_factor=1.0, shift_volt=0.0, r_std=None):
    """A cell as a model file: the same OCV, its own capacity, all resistances by one factor."""
    knots = [0.0, 0.5, 1.0]
    std = None if r_std is None else [r_std * resistance_factor * R0_OHM] * 3
    branches = [
        {"r_ohm": [resistance_factor * r] * 3, "tau_second": [tau] * 3, "r_std_ohm": std}
        for r, tau in zip(R_OHM, TAU_SECOND, strict=True)
    ]
    condition = {
        "ambient_temperature_celsius": CELSIUS,
        "soc": knots,
        "r0_ohm": [resistance_factor * R0_OHM] * 3,
        "r0_std_ohm": std,
        "branches": branches,
        "ocv_shift_volt": [shift_volt] * 3,
    }
    ocv = {"soc": SOC.tolist(), "ocv_volt": OCV_VOLT.tolist()}
    return {
        "schema": "cellwright-model/2",
        "cell": name,
        "capacity_ampere_hour": FULL_AMPERE_HOUR * capacity_share,
        "ocv": [ocv | {"ambient_temperature_celsius": CELSIUS}],
        "members": [{"model": "2RC", "conditions": [condition]}],
        "chosen": "2RC",
        "kind": "hppc",
        "notes": [],
    }


def models(shares, factors=None):
    """Models of a string, named A, B, …; capacities as shares, resistances as factors."""
    factors = np.ones(len(shares)) if factors is None else factors
    return [
        model(chr(ord("A") + k), float(share), float(factor))
        for k, (share, factor) in enumerate(zip(shares, factors, strict=True))
    ]


def of_laboratory(capacity_share=1.0, resistance_factor=1.0):
    """The same cell for the laboratory's generator, which shares no code with the models."""
    from virtual_lab import fast
    from virtual_lab.behaviour import Rating

    rating = Rating(FULL_AMPERE_HOUR, LOWER_VOLT, UPPER_VOLT)
    return fast.Cell(
        rating,
        OCV_VOLT,
        FULL_AMPERE_HOUR * capacity_share,
        resistance_factor * R0_OHM,
        tuple(resistance_factor * r for r in R_OHM),
        TAU_SECOND,
    )


def with_energy(model, joule_per_mole=30e3):
    """A model of one condition whose resistances follow an activation energy."""
    (member,) = model["members"]
    energy = {"activation_energy_joule_per_mole": joule_per_mole}
    return model | {"members": [member | {"conditions": [member["conditions"][0] | energy]}]}
