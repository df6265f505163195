"""Terminal voltage of a circuit under a measured current, with the true time stamps."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import Branch, kind_of
from cellwright.numerics.clock import refuse_backward
from cellwright.numerics.hysteresis import preisach
from cellwright.numerics.lags import lag, lag_by_charge, mean_over_steps
from cellwright.refusal import Refusal

STEP = 1e-30  # of a complex step: its square vanishes beside any real part
SOC_STEP = 1e-5  # of the slope of an OCV, which need not take complex numbers


class OpenCircuit(NamedTuple):
    """OCV over SoC (a function [1] → [V]) and the counted SoC (n,) of a record [1]."""

    volt_at: object
    soc: np.ndarray


def overpotentials(circuit, test_time_second, current_ampere, *, hold, open_circuit=None):
    """Voltage over each branch of a circuit that starts from rest.

    Parameters
    ----------
    circuit : tuple of Branch; parameters are scalars or (n,) values looked up per sample.
    test_time_second : (n,) never falling [s]; equal stamps are an edge of the current.
    current_ampere : (n,) positive on charge [A].
    hold : "zero_order" or "first_order": how the current runs between two samples.
    open_circuit : OpenCircuit, for circuits with a branch that shifts the SoC (diffusion).

    Returns
    -------
    overpotential_volt : (branches, n) [V].

    Raises
    ------
    Refusal : no sample, time runs back, values or parameters are not finite, lengths differ, an
        unknown hold or branch, or a branch that shifts the SoC without an OCV to shift.

    Source: exact solution of tau·du/dt = R·I − u between samples; thesis (2.8), (2.12), with the
    time step of each sample instead of one constant; of hysteresis (2.6), (2.16) with the sign of
    the current, which the print leaves out.
    """
    time, current = _checked(test_time_second, current_ampere)
    steps = np.diff(time)
    over_volt = []
    for branch in circuit:
        _check_parameters(branch, current.shape)
        output = _response(branch, steps, current, hold)
        if kind_of(branch).output == "soc":
            output = _shifted(output, open_circuit)
        over_volt.append(output)
    return np.array(over_volt)


def simulate(circuit, test_time_second, current_ampere, ocv_volt, *, hold, open_circuit=None):
    """Terminal voltage: open-circuit voltage plus the voltage over every branch.

    Parameters
    ----------
    circuit, test_time_second, current_ampere, hold, open_circuit : as in `overpotentials`.
    ocv_volt : scalar or (n,) open-circuit voltage at each sample [V].

    Returns
    -------
    voltage_volt : (n,) [V].
    """
    # ASSUME: Every simulated record starts from rest: all its relaxation voltages begin at zero.
    settings = {"hold": hold, "open_circuit": open_circuit}
    return ocv_volt + overpotentials(circuit, test_time_second, current_ampere, **settings).sum(0)


def sensitivities(circuit, test_time_second, current_ampere, *, hold, open_circuit=None):
    """Derivative of the terminal voltage by every parameter of a circuit.

    By complex steps: the circuit is simulated once a parameter with an imaginary part of 1e-30 on
    it, whose imaginary output is the derivative, exact to rounding. So no derivative is written by
    hand, and every kind has its own.

    Parameters
    ----------
    circuit, test_time_second, current_ampere, hold, open_circuit : as in `overpotentials`.

    Returns
    -------
    sensitivity : dict (index of the branch, name of the parameter) → (n,) [V per its unit]. A
        parameter given per sample is moved as a whole.

    Source: W. Squire, G. Trapp, SIAM Review 40 (1998) 110.
    """
    settings = {"hold": hold, "open_circuit": open_circuit}
    derivatives = {}
    for index, branch in enumerate(circuit):
        for name in kind_of(branch).parameters:
            shifted = branch.parameters | {name: branch.parameters[name] + 1j * STEP}
            single = (Branch(branch.kind, shifted),)
            run = overpotentials(single, test_time_second, current_ampere, **settings)
            derivatives[index, name] = run[0].imag / STEP
    return derivatives


def _response(branch, steps, current, hold):
    """Output of a branch (n,) [V] or [1]: the share that acts at once plus its lags."""
    kind = kind_of(branch)
    if kind.closes:
        return closing(branch, steps, current, hold)
    lags = kind.lags(**branch.parameters)
    drive = kind.drive(current, **branch.parameters)
    if any(lagged.clock == "ampere_hour" for lagged in lags):
        return _by_charge(kind, branch.parameters, lags, steps, current, hold)
    output = (1.0 - sum(lagged.share for lagged in lags)) * drive
    for lagged in lags:
        output = output + lagged.share * lag(steps, _at_start(lagged.constant), drive, hold=hold)
    return output


def _by_charge(kind, parameters, lags, steps, current, hold):
    """Sum of the lags that move with the charge passed, each step with its mean current."""
    between = mean_over_steps(current, hold)
    drive = kind.drive(between, **{name: _at_start(value) for name, value in parameters.items()})
    passed = np.abs(between) * steps / 3600.0
    return sum(
        lagged.share * lag_by_charge(passed, _at_start(lagged.constant), drive) for lagged in lags
    )


def closing(branch, steps, current, hold, *, start=0.0):
    """Voltage (n,) of a hysteresis whose small loops close [V].

    Parameters
    ----------
    branch : Branch of such a kind. steps : (n−1,) [s]. current : (n,) [A]. hold : see
    `overpotentials`. start : state before the first sample, −1 to 1.
    """
    charge = _at_start(branch.parameters["charge_ampere_hour"])
    moved = mean_over_steps(current, hold) * steps / 3600.0 / charge
    fresh = np.eye(1, len(current))[0]
    state = preisach(np.append(0.0, moved), np.full(len(current), float(start)), fresh)
    return branch.parameters["m_volt"] * state


def _at_start(value):
    """Value at the start of each step; a scalar stays a scalar."""
    return value if np.ndim(value) == 0 else np.asarray(value)[:-1]


def _shifted(offset, open_circuit):
    if open_circuit is None:
        raise Refusal("a branch shifts the SoC, but no OCV over SoC is given")
    volt_at, soc = open_circuit
    surface = soc + np.real(offset)
    shift = volt_at(surface) - volt_at(soc)
    if not np.iscomplexobj(offset):
        return shift
    slope = (volt_at(surface + SOC_STEP) - volt_at(surface - SOC_STEP)) / (2 * SOC_STEP)
    return shift + 1j * slope * offset.imag


def _checked(test_time_second, current_ampere):
    time, current = np.asarray(test_time_second, float), np.asarray(current_ampere, float)
    if time.shape != current.shape or time.ndim != 1:
        raise Refusal(f"time has shape {time.shape}, current {current.shape}; both must be (n,)")
    if not len(time):
        raise Refusal("the record holds no sample")
    if not (np.isfinite(time).all() and np.isfinite(current).all()):
        raise Refusal("time or current holds values that are not finite")
    refuse_backward(time)
    return time, current


def _check_parameters(branch, shape):
    for name, value in branch.parameters.items():
        if np.ndim(value) and np.shape(value) != shape:
            given = f"{name} of branch {branch.kind} has shape {np.shape(value)}"
            raise Refusal(f"{given}; it must be a scalar or one value per sample, {shape}")
        if not np.isfinite(value).all():
            raise Refusal(f"{name} of branch {branch.kind} is not finite")
