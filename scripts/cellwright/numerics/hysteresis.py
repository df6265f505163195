"""Hysteresis that remembers where the charge turned: stops of many widths, a Preisach model.

A one-state hysteresis forgets with every bit of charge, whichever way it goes: a load that takes
charge and gives a little of it back, as a drive does, holds it far from its branch. Lithium iron
phosphate does not do that: small turns close their loop, and the branch goes on where they began.
"""

import numpy as np
from scipy.special import gammaincinv

from cellwright.native import array, count, function

STOPS = 12
# Widths over the charge constant, gamma-distributed with shape 2: from one branch to the other
# the mean of such stops goes as 1 − 2·exp(−charge/constant), as the one state does.
WIDTHS = gammaincinv(2, (np.arange(STOPS) + 0.5) / STOPS) / 2


def preisach(moved, start, fresh):
    """State of a hysteresis whose small loops close, over records that lie one after the other.

    Each stop moves with the charge and stays where it meets its end, −1 or 1; the state is their
    mean. Along a whole charge or discharge it is the one-state hysteresis of the same constant.

    Parameters
    ----------
    moved : (n,) charge since the row before over the charge constant, positive on charge [1]; real,
        or complex for a derivative.
    start : (n,) state in first rows, −1 to 1. fresh : (n,) 1 in first rows, else 0.

    Returns
    -------
    state : (n,), −1 to 1 [1].

    Source: superposed stops: M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer
    1996, 2.3 and 2.4; their small loops in LFP: V. Srinivasan, J. Newman, Electrochem. Solid-State
    Lett. 9 (2006) A110.
    """
    types = (count, count, array, array, array, array, array, array)
    kernel = function("stops", *types)
    if kernel is None or np.iscomplexobj(moved):
        return _twin(moved, start, fresh)
    columns = (np.ascontiguousarray(one, float) for one in (moved, fresh, start))
    state = np.empty(len(moved))
    kernel(len(moved), STOPS, *columns, 1.0 / WIDTHS, np.zeros(STOPS), state)
    return state


def _twin(moved, start, fresh):
    state, stops = np.empty(len(moved), np.result_type(moved, float)), np.zeros(STOPS)
    for k, (by, begun) in enumerate(zip(moved, fresh, strict=True)):
        stops = np.full(STOPS, start[k]) if begun else stops + by / WIDTHS
        stops = np.where(np.abs(stops.real) > 1.0, np.sign(stops.real), stops)
        state[k] = stops.mean()
    return state
