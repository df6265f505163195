"""A member of the circuit family at one temperature, as tables over SoC: what filters run on."""

from typing import NamedTuple

import numpy as np

from cellwright.models.circuit import kind_of
from cellwright.models.lookup import circuit_at, member_of
from cellwright.models.tables import continued_ocv_at
from cellwright.refusal import Refusal

BEYOND = 0.25  # how far the tables go on below empty and above full
NODES = np.linspace(0.0, 1.0, 21)  # SoC at which a drive that is not linear is taken


class Element(NamedTuple):
    """One branch: `gain` (m,) is its drive at 1 A, None where the drive is not linear in the
    current; then `drive` and `parameters` (each (nodes,), at `NODES`) give it. `direct` acts at
    once; `output` is "volt", or "soc": an offset of the SoC at which the OCV is taken."""

    output: str
    direct: float
    gain: np.ndarray
    drive: object
    parameters: dict


class Relaxation(NamedTuple):
    """One lag: the element it belongs to, its clock, what share of the drive goes through it, and
    its constant (m,), [s] or [Ah]."""

    element: int
    clock: str
    share: float
    constant: np.ndarray


class Bank(NamedTuple):
    """Tables (m,) over `soc`, a uniform grid that reaches `BEYOND` 0 and 1.

    ocv_volt : open-circuit voltage, continued on its end slopes outside 0…1 [V].
    shift_volt : the member's correction of it, by the mean SoC [V].
    error_volt : RMS error that the model left on the data it was fitted to [V].
    outside : where neither resistance nor relaxation was measured.
    elements, lags : tuples of Element and Relaxation, the ohmic resistance first.
    """

    soc: np.ndarray
    ocv_volt: np.ndarray
    shift_volt: np.ndarray
    error_volt: np.ndarray
    outside: np.ndarray
    elements: tuple
    lags: tuple
    capacity_ampere_hour: float


def bank_of(model, member, temperature_celsius, *, points=201):
    """Tables of one member of a model at one temperature.

    Parameters
    ----------
    model : dict of schema cellwright-model/1.
    member : name of the member, or None for the chosen one.
    temperature_celsius : scalar [degC]; NaN takes a single condition as it is.
    points : points of the grid over SoC 0 to 1; it goes on at the same distance outside.

    Returns
    -------
    bank : Bank.

    Raises
    ------
    Refusal : the model does not say how well it fits (`fit_rmse_volt`), or as `circuit_at`.
    """
    beyond = round(BEYOND * (points - 1))
    soc = np.arange(-beyond, points + beyond) / (points - 1)
    conditions = member_of(model, member)["conditions"]
    celsius = np.full(len(soc), float(temperature_celsius))
    found = circuit_at(conditions, soc, celsius)
    return Bank(
        soc=soc,
        ocv_volt=continued_ocv_at(model["ocv"], found.table_soc, celsius),
        shift_volt=found.ocv_shift_volt,
        error_volt=np.full(len(soc), _error(conditions, temperature_celsius)),
        outside=found.outside_soc,
        elements=tuple(_element(branch, soc) for branch in found.circuit),
        lags=tuple(lag for k, branch in enumerate(found.circuit) for lag in _lags(k, branch, soc)),
        capacity_ampere_hour=model["capacity_ampere_hour"],
    )


def drives(element, current_ampere):
    """Drive of an element that is not linear in the current, at every sample and SoC node.

    Parameters
    ----------
    element : Element without a gain.
    current_ampere : (n,) the whole record [A]; a drive may look back at it (the last sign).

    Returns
    -------
    drive : (n, nodes) over `NODES`.
    """
    rows = [
        element.drive(current_ampere, **{name: v[k] for name, v in element.parameters.items()})
        for k in range(len(NODES))
    ]
    return np.array(rows).T


def _element(branch, soc):
    kind = kind_of(branch)
    lags = kind.lags(**{name: values[0] for name, values in branch.parameters.items()})
    direct = 1.0 - sum(lag.share for lag in lags)
    direct = 0.0 if abs(direct) < 1e-12 else direct
    if kind.linear:
        gain = kind.drive(np.ones(len(soc)), **branch.parameters)
        return Element(kind.output, direct, gain, None, {})
    nodes = {name: np.interp(NODES, soc, v) for name, v in branch.parameters.items()}
    return Element(kind.output, direct, None, kind.drive, nodes)


def _lags(index, branch, soc):
    for lag in kind_of(branch).lags(**branch.parameters):
        constant = np.broadcast_to(lag.constant, soc.shape)
        yield Relaxation(index, lag.clock, float(lag.share), constant)


def _error(conditions, celsius):
    """Fit error between the measured temperatures, straight in °C."""
    pairs = [(c["ambient_temperature_celsius"], c.get("fit_rmse_volt")) for c in conditions]
    if any(error is None for _, error in pairs):
        raise Refusal("the model does not say how well it fits (fit_rmse_volt): no noise is known")
    if len(pairs) == 1:
        return float(pairs[0][1])
    known, errors = zip(*sorted(pairs), strict=True)
    return float(np.interp(celsius, known, errors))
