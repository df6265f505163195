"""Terminal voltage of a circuit under a measured current, with the true time stamps."""

import numpy as np

from cellwright.models.circuit import Excitation, kind_of
from cellwright.refusal import Refusal


def overpotentials(circuit, test_time_second, current_ampere, *, hold):
    """Voltage over each branch of a circuit that starts from rest.

    Parameters
    ----------
    circuit : tuple of Branch; parameters are scalars or (n,) values looked up per sample.
    test_time_second : (n,) never falling [s]; equal stamps are an edge of the current.
    current_ampere : (n,) positive on charge [A].
    hold : "zero_order" or "first_order": how the current runs between two samples.

    Returns
    -------
    overpotential_volt : (branches, n) [V].

    Raises
    ------
    Refusal : time runs back, values are not finite, lengths differ, an unknown hold or branch.

    Source: exact solution of tau·du/dt = R·I − u between samples; thesis (2.8), (2.12), with the
    time step of each sample instead of one constant.
    """
    time, current = _checked(test_time_second, current_ampere)
    excitation = Excitation(np.diff(time), current, hold)
    return np.array([kind_of(b).voltage(excitation, **b.parameters) for b in circuit])


def simulate(circuit, test_time_second, current_ampere, ocv_volt, *, hold):
    """Terminal voltage: open-circuit voltage plus the voltage over every branch.

    Parameters
    ----------
    circuit, test_time_second, current_ampere, hold : as in `overpotentials`.
    ocv_volt : scalar or (n,) open-circuit voltage at each sample [V].

    Returns
    -------
    voltage_volt : (n,) [V].
    """
    # ASSUME: Every simulated record starts from rest: all its relaxation voltages begin at zero.
    over = overpotentials(circuit, test_time_second, current_ampere, hold=hold)
    return ocv_volt + over.sum(axis=0)


def _checked(test_time_second, current_ampere):
    time, current = np.asarray(test_time_second, float), np.asarray(current_ampere, float)
    if time.shape != current.shape or time.ndim != 1:
        raise Refusal(f"time has shape {time.shape}, current {current.shape}; both must be (n,)")
    if not (np.isfinite(time).all() and np.isfinite(current).all()):
        raise Refusal("time or current holds values that are not finite")
    if np.any(np.diff(time) < 0):
        raise Refusal(f"time runs back after sample {int(np.argmax(np.diff(time) < 0))}")
    return time, current
