"""An identified circuit by name: values, deviations, what lies at a bound."""

from typing import NamedTuple

import numpy as np

from cellwright.models.circuit import UNRESOLVED_SECOND
from cellwright.models.design import FAST_SECOND
from cellwright.models.refine import covariance_of, with_time_constants
from cellwright.models.regression import named

LINEAR_VOLT = 1e3  # a scale so wide that kinetics are linear
ABSENT_SECOND = 2e-4  # a diffusion time that stands for none
ABSENT_SHARE = 0.01  # of the capacity: charge constant of a hysteresis that was not found
AT_BOUND = 0.02  # of the logarithm of a time constant: as near as the search goes


class Element(NamedTuple):
    """A branch of a fitted circuit: its kind, and dicts name → (k,) of values and deviations."""

    kind: str
    values: dict
    stds: dict


class Condition(NamedTuple):
    """A fitted circuit over SoC at one temperature; a deviation is NaN at a bound or if held.

    soc : (k,). r0_ohm, r0_std_ohm, ocv_shift_volt : (k,). branches : tuple of Element.
    missing, stretch : the SoC at which the OCV table is read, see `design.Held`.
    at_bound : names. fit_rmse_volt, samples : of the rows used.
    """

    soc: np.ndarray
    r0_ohm: np.ndarray
    r0_std_ohm: np.ndarray
    branches: tuple
    ocv_shift_volt: np.ndarray
    missing: float
    stretch: float
    at_bound: tuple
    fit_rmse_volt: float
    samples: int


def condition_of(data, member, held, system, solution, bounds):
    """Name the pieces, with the deviations of the time constants where these were searched.

    Parameters
    ----------
    data : design.Data. member : members.Member. held : design.Held.
    system, solution : regression.System, Solution of what is held.
    bounds : (low, high) of searched time constants [s]; None where they are a fixed series.

    Returns
    -------
    condition : Condition.
    """
    values, stds, tau_stds = solution.values, solution.stds, np.full(len(held.tau_second), np.nan)
    at_bound = []
    if bounds is not None and held.tau_second:
        stds, tau_stds = _with_time_constants(data, held, system, solution)
        log = np.log(held.tau_second)
        edge = (np.abs(log - np.log(bounds[0])) < AT_BOUND) | (
            np.abs(log - np.log(bounds[1])) < AT_BOUND
        )
        at_bound = [f"tau{n}" for n, at in enumerate(edge, 1) if at]
        tau_stds = np.where(edge, np.nan, tau_stds)
    zero = [
        f"{name.upper()} at SoC {soc:.3f}"
        for name in system.names
        for soc, value in zip(data.knots, values[name], strict=True)
        if value == 0
    ]
    if held.charge_ampere_hour is not None and data.most_volt is not None:
        full = zip(data.knots, values["m"] >= data.most_volt, strict=True)
        zero += [
            f"M at SoC {soc:.3f}, the most that the slow test allows" for soc, at in full if at
        ]
    return Condition(
        data.knots,
        values["r0"],
        stds["r0"],
        _elements(data, member, held, values, stds, tau_stds),
        values["shift"],
        held.missing,
        held.stretch,
        (*at_bound, *zero),
        float(np.sqrt(np.mean(solution.residual_volt**2))),
        len(solution.residual_volt),
    )


def _elements(data, member, held, values, stds, tau_stds):
    """Branches of a member, the same at every temperature: what was not found there is nothing."""
    same, found = np.ones(len(data.knots)), []
    taus = zip(held.tau_second, tau_stds, strict=True)
    pairs = [(f"r{n}", tau, std) for n, (tau, std) in enumerate(taus, 1)]
    if member.kinetic:
        pairs.insert(0, ("rct", UNRESOLVED_SECOND, np.nan))
    for name, tau, tau_std in pairs:
        what = {"r_ohm": values.get(name, 0.0 * same), "tau_second": tau * same}
        std = {"r_ohm": stds.get(name, np.nan * same), "tau_second": tau_std * same}
        kinetic = member.kinetic and tau <= FAST_SECOND
        if kinetic:
            what["scale_volt"] = (held.scale_volt or LINEAR_VOLT) * same
            std["scale_volt"] = np.nan * same
        found.append(Element("kinetic" if kinetic else "RC", what, std))
    if member.diffusion:
        second = held.diffusion_second or ABSENT_SECOND
        gain = second / 15.0 / 3600.0 / data.capacity_ampere_hour
        what = {"soc_per_ampere": gain * same, "tau_second": second * same}
        found.append(Element("diffusion", what, dict.fromkeys(what, np.nan * same)))
    if member.hysteresis:
        charge = held.charge_ampere_hour or ABSENT_SHARE * data.capacity_ampere_hour
        what = {"m_volt": values.get("m", 0.0 * same), "charge_ampere_hour": charge * same}
        std = {"m_volt": stds.get("m", np.nan * same), "charge_ampere_hour": np.nan * same}
        found.append(Element("hysteresis", what, std))
    return tuple(found)


def _with_time_constants(data, held, system, solution):
    """Deviations with the time constants free as well."""
    free = with_time_constants(data, held, system, solution)
    std = np.sqrt(np.diag(covariance_of(free, solution)))
    size = len(solution.vector)
    return named(system, std[:size]), std[size:] * np.asarray(held.tau_second)
