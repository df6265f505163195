"""Effects that are in no vocabulary: a search must say "unknown" and where the gap sits."""

import numpy as np

from virtual_lab.hidden.setup import SOC
from virtual_lab.hidden.vocabulary import Effect


def _ripple(setup, size, drawn):
    """Interference: a slow wave on the voltage."""
    turn = 2 * np.pi / drawn["period_second"]
    return setup._replace(disturbance=lambda second, _: size * np.sin(turn * second))


def _contact(setup, size, drawn):
    """A contact that is now and then worse, for minutes."""
    random = np.random.default_rng(drawn["seed"])
    change = np.cumsum(random.exponential(drawn["mean_second"], 2000))

    def disturbance(second, ampere):
        return size * ampere * (np.searchsorted(change, second) % 2)

    return setup._replace(disturbance=disturbance)


def _ocv_bump(setup, size, drawn):
    """A step of the OCV up and down again, in a place where no electrode has one."""
    bump = size * np.exp(-(((SOC - drawn["soc"]) / drawn["width_soc"]) ** 2))
    return setup.with_cell(ocv_volt=setup.cell.ocv_volt + bump)


def _between(**limits):
    return lambda random: {name: float(random.uniform(*ends)) for name, ends in limits.items()}


def _contact_draws(random):
    return {"mean_second": float(random.uniform(100, 400)), "seed": int(random.integers(2**31))}


OUTSIDE = {
    "resistance_drift": Effect(
        "relative_per_hour",
        0.05,
        2.0,
        lambda setup, size, _: setup.with_cell(r0_drift_per_hour=size),
    ),
    "ripple": Effect("amplitude_volt", 4e-3, 0.05, _ripple, _between(period_second=(60.0, 300.0))),
    "contact": Effect("resistance_ohm", 4e-3, 0.1, _contact, _contact_draws),
    "ocv_bump": Effect(
        "amplitude_volt", 0.02, 0.2, _ocv_bump, _between(soc=(0.3, 0.8), width_soc=(0.012, 0.025))
    ),
}
