"""Tables over SoC of one member at one temperature, as filters use them."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS
from cellwright.circuits.circuit import kind_of
from cellwright.circuits.model_file import capacity_of, circuit_at, member_of
from cellwright.circuits.temperature import continued_ocv_at
from cellwright.numerics.statistics import NORMAL_90, rms
from cellwright.records.basis import stated_or_reference
from cellwright.records.conditions import at_rest
from cellwright.records.counting import SOC_STD
from cellwright.refusal import Refusal

BEYOND = 0.25  # how far the tables go on below empty and above full
NODES = np.linspace(0.0, 1.0, 21)  # SoC at which a drive that is not linear is taken
ABSENT = 1e-6  # [V] or [1] at 1C: a branch that was not found is kept in a model, as this or less
STRAIGHT = 1e-6  # a drive that departs by less from a straight line up to ±20C is one
UNSEEN = 2.0  # error on data not seen over that of the fit, where a model does not tell it
SIDE = 0.01  # of the SoC, to both sides: over which the slope of the OCV is taken


class Element(NamedTuple):
    """One branch: `gain` (m,) is its drive at 1 A, None where the drive is not linear in the
    current; then `drive` and `parameters` (each (nodes,), at `NODES`) give it. `direct` acts at
    once; `output` is "volt", or "soc": an offset of the SoC at which the OCV is taken."""

    output: str
    direct: float
    gain: np.ndarray
    drive: object
    parameters: dict


class Bank(NamedTuple):
    """Tables (m,) over `soc`, a uniform grid that reaches `BEYOND` 0 and 1.

    ocv_volt : open-circuit voltage, continued on its end slopes outside 0…1 [V].
    shift_volt : the member's correction of it, by the mean SoC [V].
    error_volt : deviation of the model at rest, on data that it was not fitted to [V].
    load_error_volt, load_shares : what the circuit adds to it under load [V], and as a share of
        what acts at once and of what lasts of the overvoltage [1].
    outside : where neither resistance nor relaxation was measured.
    elements : tuple of Element, the ohmic resistance first. lags : tuple of (number of the element,
    its circuit.Lag, with constants (m,)).
    """

    soc: np.ndarray
    ocv_volt: np.ndarray
    shift_volt: np.ndarray
    error_volt: np.ndarray
    load_error_volt: float
    load_shares: np.ndarray
    outside: np.ndarray
    elements: tuple
    lags: tuple
    capacity_ampere_hour: float


def bank_of(model, member, temperature_celsius, *, points=POINTS):
    """Tables of one member of a model at one temperature.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
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
    entry = member_of(model, member)
    capacity = capacity_of(model, entry, temperature_celsius)
    beyond = round(BEYOND * (points - 1))
    soc = np.arange(-beyond, points + beyond) / (points - 1)
    celsius = np.full(len(soc), float(temperature_celsius))
    sampled = circuit_at(entry["conditions"], soc, celsius)
    ocv_volt = continued_ocv_at(model["ocv"], sampled.table_soc, celsius)
    stretch = np.gradient(sampled.table_soc, soc)
    branches = [b for k, b in enumerate(sampled.circuit) if k == 0 or _has_effect(b, soc, capacity)]
    slope = _slope_of(soc, ocv_volt + sampled.ocv_shift_volt, sampled.outside_soc)
    return Bank(
        soc=soc,
        ocv_volt=ocv_volt,
        shift_volt=sampled.ocv_shift_volt,
        **_model_errors(model, entry, temperature_celsius, *slope),
        outside=sampled.outside_soc,
        elements=tuple(_element(branch, soc, stretch, capacity) for branch in branches),
        lags=tuple(lag for k, branch in enumerate(branches) for lag in _lags(k, branch, soc)),
        capacity_ampere_hour=capacity,
    )


def drives(element, current_ampere):
    """Drive of an element that is not linear in the current, at every sample and SoC node.

    Parameters
    ----------
    element : Element without a gain.
    current_ampere : (n,) the whole record [A]; a drive may look back at it (the last sign).

    Returns
    -------
    drive : (nodes, n) over `NODES`.
    """
    rows = [
        element.drive(current_ampere, **{name: v[k] for name, v in element.parameters.items()})
        for k in range(len(NODES))
    ]
    return np.array(rows)


def hysteresis_of(bank):
    """Largest distance (m,) [V] at which a hysteresis of the member holds a rest off the OCV."""
    sizes = [element.parameters.get("m_volt", np.zeros(len(NODES))) for element in bank.elements]
    return np.interp(bank.soc, NODES, np.sum(sizes, axis=0))


def resistance_factor_of(model, member, celsius, reference_celsius):
    """Resistance of a cell along its temperature (n,), relative to one temperature [1].

    Parameters
    ----------
    model, member : as in `bank_of`.
    celsius : (n,) [degC]. reference_celsius : scalar [degC].

    Returns
    -------
    resistance_factor : (n,) of the sum of all resistances at half charge [1]; one where the model
        has no temperature.
    """
    course = np.append(np.asarray(celsius, float), reference_celsius)
    grid = np.linspace(course.min(), course.max(), 101)
    conditions = member_of(model, member)["conditions"]
    circuit = circuit_at(conditions, np.full(len(grid), 0.5), grid).circuit
    total = sum(b.parameters["r_ohm"] for b in circuit if "r_ohm" in b.parameters)
    resistance = np.interp(course, grid, total)
    return resistance[:-1] / resistance[-1]


# ASSUME: OCV and time constants of a filter stand at the mean temperature of a record under load;
# resistances follow the temperature.
def loaded_mean(current_ampere, celsius, capacity_ampere_hour):
    """Mean temperature of a record under load [degC], for the tables of the whole record.

    Parameters
    ----------
    current_ampere, celsius : (n,) [A], [degC]. capacity_ampere_hour : of the cell [Ah].
    """
    loaded = ~at_rest(current_ampere, capacity_ampere_hour)
    return float(np.mean(celsius[loaded] if loaded.any() else celsius))


def _has_effect(branch, soc, capacity):
    """Whether the drive of a branch at 1C is above `ABSENT`."""
    current = np.full(len(soc), capacity)
    return np.abs(kind_of(branch).drive(current, **branch.parameters)).max() > ABSENT


def _element(branch, soc, stretch, capacity):
    """Element of a branch; `stretch` (m,): change of the OCV table's SoC per counted SoC."""
    kind = kind_of(branch)
    lags = kind.lags(**{name: values[0] for name, values in branch.parameters.items()})
    direct = 1.0 - sum(lag.share for lag in lags)
    direct = 0.0 if abs(direct) < 1e-12 else direct
    if kind.linear or _is_straight(kind, branch, soc, capacity):
        gain = kind.drive(np.ones(len(soc)), **branch.parameters)
        gain = gain / stretch if kind.output == "soc" else gain
        return Element(kind.output, direct, gain, None, {})
    nodes = {name: np.interp(NODES, soc, v) for name, v in branch.parameters.items()}
    return Element(kind.output, direct, None, kind.drive, nodes)


def _is_straight(kind, branch, soc, capacity):
    """Whether a drive is proportional to the current up to 20C."""
    currents = capacity * np.array([1.0, 20.0, -1.0, -20.0])
    resistances = [kind.drive(np.full(len(soc), i), **branch.parameters) / i for i in currents]
    return np.ptp(resistances, axis=0).max() <= STRAIGHT * np.abs(resistances[0]).max()


def _lags(number, branch, soc):
    for lag in kind_of(branch).lags(**branch.parameters):
        yield number, lag._replace(constant=np.broadcast_to(lag.constant, soc.shape))


# ASSUME: Of the error of a model that states no interval, half the variance that all temperatures
# share belongs to the OCV. The other half, and what single temperatures add, belongs to the circuit
# and acts under load only.
def _model_errors(model, member, celsius, slope_volt, level_volt):
    """Errors of a bank on unseen data: those of the model's interval, else as in the fit.

    Without an interval they are over temperature straight in °C, and as much larger than in the fit
    as the error of all blocks left out is. slope_volt, level_volt : of the OCV, see `_slope_of`.
    """
    # A model file of before states none of a circuit alone.
    of_member = [e for e in model.get("intervals", ()) if e["model"] == member["model"]]
    stated = [e for e in of_member if "alone" in e]
    if stated:
        reading, at_once, lasting, of_soc = np.array(stated[0]["alone"]) / NORMAL_90
        shares = {"load_error_volt": 0.0, "load_shares": np.array([at_once, lasting])}
        start = max(stated[0]["start_soc_std"], SOC_STD) * slope_volt
        return {"error_volt": np.hypot(reading + of_soc * slope_volt, start)} | shares
    conditions = member["conditions"]
    pairs = [(c["ambient_temperature_celsius"], c.get("fit_rmse_volt")) for c in conditions]
    if any(error is None for _, error in pairs):
        raise Refusal("the model does not say how well it fits (fit_rmse_volt): no noise is known")
    errors = np.array([error for _, error in pairs])
    left_out = member.get("left_out_rmse_volt")
    samples = [c.get("samples", 1) for c in conditions]
    overall = np.sqrt(np.average(errors**2, weights=samples))
    errors = errors * (UNSEEN if left_out is None else left_out / max(overall, 1e-9))
    rest = errors.min() / np.sqrt(2.0)
    known = np.array([stated_or_reference(stated) for stated, _ in pairs])
    order = np.argsort(known)
    at_celsius = np.interp(celsius, known[order], errors[order])
    return {
        "error_volt": rest
        * (slope_volt / level_volt if level_volt > 0.0 else np.ones(len(slope_volt))),
        "load_error_volt": float(np.sqrt(at_celsius**2 - rest**2)),
        "load_shares": np.zeros(2),
    }


# ASSUME: A model's error goes with the slope of the OCV, as that of a wrong SoC: it is told as one
# number, most of which comes from near empty, where voltage and resistance bend.
def _slope_of(soc, volt, outside):
    """Slope of the OCV at every SoC (m,), and its RMS over the measured range [V]."""
    sides = soc + SIDE, soc - SIDE
    slope = np.abs(np.interp(sides[0], soc, volt) - np.interp(sides[1], soc, volt)) / (2 * SIDE)
    measured = (~outside) & (soc >= 0.0) & (soc <= 1.0)
    return slope, rms(slope[measured]) if measured.any() else 0.0
