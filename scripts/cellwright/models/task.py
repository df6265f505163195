"""What a fit is asked: names of the parameters, their limits, and the record as a linear model."""

import numpy as np

from cellwright.models.kernels import HOLDS
from cellwright.models.normal import Load
from cellwright.refusal import Refusal

OFFSET, SLOPE = "ocv_offset_volt", "ocv_slope_volt_per_ampere_hour"


def names_of(n_rc, free_ocv):
    """Names of the parameters in the order of the linear model: linear ones, then ln tau.

    Parameters
    ----------
    n_rc, free_ocv : as in `fit.fit_circuit`.
    """
    unknown = set(free_ocv) - {"offset", "slope"}
    if unknown or not 0 <= n_rc <= 4:
        raise Refusal(f"{n_rc} RC pairs, free OCV {sorted(free_ocv)}; 0 to 4, 'offset', 'slope'")
    extra = [OFFSET] * ("offset" in free_ocv) + [SLOPE] * ("slope" in free_ocv)
    pairs = range(1, n_rc + 1)
    taus = [f"tau{j}_second" for j in pairs]
    return ("r0_ohm", *extra, *(f"r{j}_ohm" for j in pairs), *taus)


def load_of(test_time_second, current_ampere, voltage_volt, ocv_volt, hold, free_ocv):
    """A record as the linear model, checked.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, ocv_volt : as in `fit.fit_circuit`.
    hold, free_ocv : as there.
    """
    time, current, voltage = (
        np.asarray(c, float) for c in (test_time_second, current_ampere, voltage_volt)
    )
    ocv = np.asarray(ocv_volt, float)
    _check(time, current, voltage, ocv, hold)
    # Stamps of a uniform clock differ in their last digits: to the nanosecond they do not, and the
    # exponentials of a step are taken once.
    step = np.rint(np.diff(time) * 1e9) / 1e9
    fixed = [current]
    if "offset" in free_ocv:
        fixed.append(np.ones(len(time)))
    if "slope" in free_ocv:
        between = current[:-1] if hold == "zero_order" else (current[:-1] + current[1:]) / 2
        fixed.append(np.concatenate([[0.0], np.cumsum(step * between)]) / 3600.0)
    target = np.ascontiguousarray(voltage - ocv)
    return Load(step, np.ascontiguousarray(current), np.vstack(fixed), target, hold)


def limits_of(names, load, bounds):
    """Limits of the search of every parameter: (lower, upper), (p,) each, in its unit.

    Parameters
    ----------
    names : of the parameters.
    load : normal.Load, whose shortest step and whole length limit the time constants.
    bounds : dict, name → (lower, upper), that stand in place of the usual ones.
    """
    unknown = set(bounds) - set(names)
    if unknown:
        raise Refusal(f"bounds of {', '.join(sorted(unknown))}; parameters are {', '.join(names)}")
    positive = load.step_second[load.step_second > 0]
    usual = {"tau": (positive.min(), load.step_second.sum()), "ocv": (-np.inf, np.inf)}
    pairs = [bounds.get(name, usual.get(name[:3], (0.0, np.inf))) for name in names]
    for name, (lower, upper) in zip(names, pairs, strict=True):
        if not lower <= upper or (name[:3] == "tau" and lower <= 0):
            raise Refusal(f"bounds of {name} are {lower} to {upper}; they must ascend, tau above 0")
    lower, upper = np.array(pairs, float).T
    return lower, upper


def _check(time, current, voltage, ocv, hold):
    if time.ndim != 1 or not time.shape == current.shape == voltage.shape:
        found = f"time {time.shape}, current {current.shape}, voltage {voltage.shape}"
        raise Refusal(f"{found}; all must be (n,)")
    if ocv.shape not in ((), time.shape):
        raise Refusal(f"OCV has shape {ocv.shape}; a scalar or {time.shape} is wanted")
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a relaxation needs a course of time")
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    if not all(np.isfinite(column).all() for column in (time, current, voltage, ocv)):
        raise Refusal("time, current, voltage or OCV holds values that are not finite")
    if np.any(time[1:] < time[:-1]):
        raise Refusal(f"time runs back after sample {int(np.argmax(np.diff(time) < 0))}")
    if time[-1] <= time[0]:
        raise Refusal("all samples carry the same time stamp")
    if current.max() == current.min():
        raise Refusal(f"current is {current[0]:g} A throughout: no step tells resistance from OCV")
