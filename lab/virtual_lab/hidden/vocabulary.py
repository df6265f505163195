"""How each hidden effect acts on a cell or its measuring channel (ids as in the contract).

An effect has one size, by which its strength is set, and further parameters that are drawn. Those
of OUTSIDE are in no vocabulary: a search must say "unknown" and where the gap is.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from virtual_lab import electrodes
from virtual_lab.hidden.setup import CHEMISTRY, RATING, SOC, Setup

LOW_SOC = np.exp(-SOC / 0.15)
SHAPES = {
    # Tables over SoC, zero in the mean, about one from end to end.
    "rising_towards_empty": LOW_SOC - LOW_SOC.mean(),
    "falling_with_soc": 0.5 - SOC,
    "bowl": 4 * (SOC - 0.5) ** 2 - 1 / 3,
}
Drawn = dict[str, Any]


class Effect(NamedTuple):
    """One effect.

    `parameter`: name of its size, with the unit. `first`: the size from which a strength is
    searched, `most`: the largest that is still a cell or an instrument. `act(setup, size, drawn)`
    gives the setup with the effect in it. `draw(random)` gives the further parameters; where the
    sign is free (`either_sign`) it is already in the size that `act` receives. `on_drives`: its
    strength is measured on drives only, since at the sharp edges of pulses it depends on the
    clock.
    """

    parameter: str
    first: float
    most: float
    act: Callable[[Setup, float, Drawn], Setup]
    draw: Callable[[np.random.Generator], Drawn] = lambda random: {}
    either_sign: bool = False
    on_drives: bool = False


def _shape(random):
    """A drawn shape of a table over SoC."""
    return {"shape": str(random.choice(sorted(SHAPES)))}


def _factor(size, drawn):
    """Table over SoC [1] of a drawn shape and a size, positive everywhere."""
    return np.maximum(1 + size * SHAPES[drawn["shape"]], 0.1)


def _resistance_soc(setup, size, drawn):
    return setup.with_cell(r0_factor=_factor(size, drawn))


def _polarisation_soc(setup, size, drawn):
    pairs = len(setup.cell.pair_r_ohm)
    return setup.with_cell(pair_factor=(_factor(size, drawn),) * pairs)


def _slow_form(random):
    form = str(random.choice(["third_rc", "warburg"]))
    low, high = {"third_rc": (600.0, 2500.0), "warburg": (1500.0, 6000.0)}[form]
    second = float(np.exp(random.uniform(np.log(low), np.log(high))))
    return {"form": form, "time_constant_second": second}


def _slow_diffusion(setup, size, drawn):
    second = drawn["time_constant_second"]
    if drawn["form"] == "warburg":
        return setup.with_cell(warburg_r_ohm=size, warburg_tau_second=second)
    cell = setup.cell
    more = {"pair_r_ohm": size, "pair_tau_second": second, "pair_factor": 1.0}
    more["pair_activation_joule_per_mole"] = cell.r0_activation_joule_per_mole
    # An empty table holds for every pair, and so for one more.
    longer = {
        name: (*getattr(cell, name), one) for name, one in more.items() if getattr(cell, name)
    }
    return setup.with_cell(**longer)


def _kinetics(setup, size, drawn):
    return setup.with_cell(
        kinetic_share=drawn["share_of_resistance"], exchange_current_ampere=1 / size
    )


def _resistance_temperature(setup, size, _):
    pairs = len(setup.cell.pair_r_ohm)
    return setup.with_cell(
        r0_activation_joule_per_mole=size, pair_activation_joule_per_mole=(size,) * pairs
    )


def _entropic(setup, size, drawn):
    table = {"even": np.ones(SOC.size), "changing_sign": 2 * (0.5 - SOC)}[drawn["shape"]]
    return setup.with_cell(entropic_volt_per_kelvin=size * table)


def _self_heating(setup, size, drawn):
    """Resistances follow the cell's own heat; the chamber's temperature does not change them."""
    energy, second = drawn["activation_energy_joule_per_mole"], drawn["time_constant_second"]
    rise = {"rise_kelvin_per_watt": size, "rise_tau_second": second}
    return setup.with_cell(**rise, rise_activation_joule_per_mole=energy)


def _heating_draws(random):
    return {
        "activation_energy_joule_per_mole": 30e3,
        "time_constant_second": float(random.uniform(250.0, 600.0)),
    }


def _capacity_error(setup, size, _):
    """The cell's capacity has changed since its capacity test."""
    then = setup.cell
    now = setup.with_cell(capacity_ampere_hour=then.capacity_ampere_hour * (1 + size))
    return now._replace(at_capacity_test=then)


def _ocv_shift(setup, size, drawn):
    """Losses shift the electrodes against each other; the capacity falls accordingly."""
    fresh = electrodes.window(CHEMISTRY, RATING)
    aged = electrodes.window(CHEMISTRY, RATING, **{drawn["loss"]: size})
    moved = electrodes.open_circuit_volt(CHEMISTRY, aged, SOC)
    moved -= electrodes.open_circuit_volt(CHEMISTRY, fresh, SOC)
    kept = aged.capacity_ampere_hour / fresh.capacity_ampere_hour
    return setup.with_cell(
        ocv_volt=setup.cell.ocv_volt + moved,
        capacity_ampere_hour=setup.cell.capacity_ampere_hour * kept,
    )


def _ocv_edge(setup, size, drawn):
    distance = SOC if drawn["end"] == "empty" else 1 - SOC
    return setup.with_cell(ocv_volt=setup.cell.ocv_volt + size * np.exp(-distance / 0.08))


def _in_cell(field):
    """An action that sets one parameter of the cell to the size."""
    return lambda setup, size, _: setup.with_cell(**{field: size})


def _in_chain(field):
    """An action that sets one setting of the channel to the size."""
    return lambda setup, size, _: setup.with_chain(**{field: size})


def _uniform_draws(**limits):
    """A draw of numbers, each uniform between its limits."""
    return lambda random: {name: float(random.uniform(*ends)) for name, ends in limits.items()}


def _choice(name, *values):
    return lambda random: {name: str(random.choice(values))}


EFFECTS = {
    "hysteresis_instant": Effect("amplitude_volt", 5e-3, 0.05, _in_cell("hysteresis_instant_volt")),
    "hysteresis_one_state": Effect(
        "amplitude_volt",
        0.01,
        0.1,
        lambda setup, size, drawn: setup.with_cell(
            hysteresis_volt=size, hysteresis_per_soc=drawn["rate_per_soc"]
        ),
        _uniform_draws(rate_per_soc=(10.0, 30.0)),
    ),
    "resistance_asymmetry": Effect(
        "charge_resistance_excess_relative", 0.2, 2.0, _in_cell("charge_asymmetry")
    ),
    "resistance_soc": Effect("amount_relative", 0.3, 4.0, _resistance_soc, _shape),
    "polarisation_soc": Effect("amount_relative", 0.3, 4.0, _polarisation_soc, _shape),
    "slow_diffusion": Effect("resistance_ohm", 4e-3, 0.05, _slow_diffusion, _slow_form),
    # Beyond 1.1 /A the gap shrinks again: too little of the resistance remains.
    "charge_transfer_nonlinearity": Effect(
        "per_exchange_current_per_ampere",
        0.15,
        1.1,
        _kinetics,
        _uniform_draws(share_of_resistance=(0.6, 0.8)),
    ),
    "resistance_temperature": Effect(
        "activation_energy_joule_per_mole", 5e3, 60e3, _resistance_temperature
    ),
    "entropic_ocv": Effect(
        "coefficient_volt_per_kelvin",
        2e-4,
        2e-3,
        _entropic,
        _choice("shape", "even", "changing_sign"),
        either_sign=True,
    ),
    "self_heating": Effect(
        "thermal_resistance_kelvin_per_watt", 1.0, 30.0, _self_heating, _heating_draws
    ),
    "capacity_temperature": Effect(
        "relative_per_kelvin", 1e-3, 6e-3, _in_cell("capacity_per_kelvin")
    ),
    "coulombic_inefficiency": Effect(
        "lost_share_of_charge",
        0.01,
        0.1,
        lambda setup, size, _: setup.with_cell(coulombic_efficiency=1 - size),
    ),
    "leakage": Effect("leak_ampere", 5e-3, 0.1, _in_cell("leak_ampere")),
    "capacity_error": Effect("relative", 0.01, 0.15, _capacity_error, either_sign=True),
    "ocv_shift": Effect(
        "loss_relative",
        0.02,
        0.09,
        _ocv_shift,
        _choice("loss", "lli", "lam_negative", "lam_positive"),
    ),
    "ocv_edge": Effect(
        "amplitude_volt", 0.02, 0.06, _ocv_edge, _choice("end", "empty", "full"), either_sign=True
    ),
    "current_offset": Effect(
        "offset_ampere", 5e-3, 0.1, _in_chain("current_offset_ampere"), either_sign=True
    ),
    "current_gain": Effect(
        "gain_relative", 0.01, 0.05, _in_chain("current_gain"), either_sign=True
    ),
    "voltage_offset": Effect(
        "offset_volt", 3e-3, 0.05, _in_chain("voltage_offset_volt"), either_sign=True
    ),
    "voltage_gain": Effect(
        "gain_relative", 1e-3, 0.02, _in_chain("voltage_gain"), either_sign=True
    ),
    "time_skew": Effect(
        "voltage_delay_second",
        0.1,
        2.0,
        _in_chain("voltage_delay_second"),
        either_sign=True,
        on_drives=True,
    ),
    "lead_resistance": Effect(
        "resistance_ohm",
        2e-3,
        0.02,
        lambda setup, size, _: setup.with_cell(r0_ohm=setup.cell.r0_ohm + size),
    ),
}
# Effects that leave no gap, for a healthy cell with other parameters gives the same record; sizes.
INVISIBLE = {"lead_resistance": 4e-3, "current_gain": 0.01}


def _ripple(setup, size, drawn):
    """Interference: a slow sine on the voltage."""
    turn = 2 * np.pi / drawn["period_second"]
    return setup._replace(disturbance=lambda second, _: size * np.sin(turn * second))


def _contact(setup, size, drawn):
    """A contact whose resistance rises for minutes now and then."""
    random = np.random.default_rng(drawn["seed"])
    change = np.cumsum(random.exponential(drawn["mean_second"], 2000))

    def disturbance(second, ampere):
        return size * ampere * (np.searchsorted(change, second) % 2)

    return setup._replace(disturbance=disturbance)


def _ocv_bump(setup, size, drawn):
    """A bump of the OCV where no electrode has one."""
    bump = size * np.exp(-(((SOC - drawn["soc"]) / drawn["width_soc"]) ** 2))
    return setup.with_cell(ocv_volt=setup.cell.ocv_volt + bump)


def _contact_draws(random):
    return {"mean_second": float(random.uniform(100, 400)), "seed": int(random.integers(2**31))}


OUTSIDE = {
    "resistance_drift": Effect("relative_per_hour", 0.05, 2.0, _in_cell("r0_drift_per_hour")),
    "ripple": Effect(
        "amplitude_volt", 4e-3, 0.05, _ripple, _uniform_draws(period_second=(60.0, 300.0))
    ),
    "contact": Effect("resistance_ohm", 4e-3, 0.1, _contact, _contact_draws),
    "ocv_bump": Effect(
        "amplitude_volt",
        0.02,
        0.2,
        _ocv_bump,
        _uniform_draws(soc=(0.3, 0.8), width_soc=(0.012, 0.025)),
    ),
}
