"""What depends on its own answer: the SoC's scale and the kinetics, solved until they settle."""

import numpy as np

from cellwright.models.design import FAST_SECOND, columns_of
from cellwright.models.regression import SCALES, solved, system_of

WIDEST = 0.1  # change of the SoC's scale that is believed
SETTLED = 2e-4  # change of the SoC's scale that is small enough
STEADY = 0.003  # change of the charge-transfer resistance that is small enough, of its largest


def settled(data, held, *, passes=10):
    """Let the SoC's scale and the kinetics settle: (held, system, solution).

    Parameters
    ----------
    data : design.Data.
    held : design.Held.
    passes : how often at most the problem is solved about what was found before.
    """
    if held.scale_volt is not None and held.transfer_ohm is None:
        linear = solved(system_of(columns_of(data, held._replace(scale_volt=None)), data.knots))
        held = held._replace(transfer_ohm=_transfer(held, linear.values, half=True))
    last, share = 0.0, 1.0
    for _ in range(passes - 1):
        solution = solved(system_of(columns_of(data, held), data.knots))
        scale = np.clip(np.array([held.missing, held.stretch]) + solution.scale, -WIDEST, WIDEST)
        still = np.abs(solution.scale).max() < SETTLED
        held = held._replace(missing=float(scale[0]), stretch=float(scale[1]))
        if held.scale_volt is not None:
            way = _transfer(held, solution.values) - held.transfer_ohm
            # More resistance damps itself more: in whole steps the two may take turns for ever.
            share = share / 2 if np.sum(way * last) < 0 else share
            held = held._replace(transfer_ohm=held.transfer_ohm + share * way)
            still = still and np.abs(way).max() < STEADY * held.transfer_ohm.max()
            last = way
        if still:
            break
    system = system_of(columns_of(data, held), data.knots)
    solution = at_scale(system, solved(system))
    if held.scale_volt is not None:
        held = held._replace(transfer_ohm=_transfer(held, solution.values))
    return held, system, solution


def at_scale(system, solution):
    """What belongs to the scale as it is held, with the deviations of a scale that is free.

    A last change that is not made would leave values that belong to another scale.

    Parameters
    ----------
    system, solution : regression.System, its Solution with the scale's change.
    """
    count = len(system.knots)
    matrix = system.matrix.copy()
    matrix[:, count : count + SCALES] = 0.0
    held = solved(system._replace(matrix=matrix))
    return held._replace(stds=solution.stds, covariance=solution.covariance)


def _transfer(held, values, *, half=False):
    """Charge-transfer resistance at the knots; before it was told apart, half of the ohmic one."""
    fast = [values[f"r{n}"] for n, tau in enumerate(held.tau_second, 1) if tau <= FAST_SECOND]
    return sum(fast, 0.5 * values["r0"] if half else values["rct"])


def cheapest(data, tries, factor):
    """What costs least, all measured by one noise, after two passes each.

    Parameters
    ----------
    data : design.Data. tries : list of design.Held. factor : weight of the data, of one solution.

    Returns
    -------
    held : design.Held.
    """
    near = [settled(data, held, passes=2)[0] for held in tries]
    costs = [cost_of(data, held, factor) for held in near]
    return near[int(np.argmin(costs))]


def cost_of(data, held, factor):
    """Cost of what is held, at a given weight of the data (see `regression.Solution`).

    Parameters
    ----------
    data : design.Data. held : design.Held. factor : weight of the data.
    """
    return solved(system_of(columns_of(data, held), data.knots), factor=factor).cost
