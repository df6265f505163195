"""What a sensor makes of a quantity that goes on over the steps of a test: late and low-passed.

The quantity is known at any instant, so nothing here shifts or filters samples.
"""

from collections.abc import Callable, Sequence

import numpy as np

Piece = Callable[[np.ndarray], np.ndarray]
# Ages over which a first-order low-pass remembers, in time constants; what is older weighs 2e-9.
AGE = np.concatenate([[0.0], np.geomspace(0.02, 20.0, 60)])
ROWS_AT_ONCE = 50_000


def reading(
    pieces: Sequence[Piece],
    durations_second: np.ndarray,
    second: np.ndarray,
    *,
    lag_second: float = 0.0,
    delay_second: float = 0.0,
) -> np.ndarray:
    """What a sensor shows of a quantity.

    Parameters
    ----------
    pieces : the quantity in each step, a function of the time [s] since the step began.
    durations_second : of the steps, shape (n,).
    second : instants from the start of the test, ascending, shape (m,); one that falls on the end
        of a step belongs to it, not to the next.
    lag_second : time constant of a first-order low-pass, y' = (x − y)/τ; 0: none.
    delay_second : what is shown at t was there at t − delay; negative: it is shown early.

    Returns
    -------
    Array, shape (m,). Before the first step the quantity is as it begins, after the last as it
    ends.
    """
    begins = np.concatenate([[0.0], np.cumsum(durations_second)])
    asked = second - delay_second
    if lag_second == 0:
        return _at(pieces, begins, asked)
    parts = np.array_split(asked, asked.size // ROWS_AT_ONCE + 1)
    return np.concatenate([_low_passed(pieces, begins, part, lag_second) for part in parts])


def _at(pieces, begins, second):
    """The quantity itself, at ascending instants."""
    inside = np.clip(second, 0.0, begins[-1])
    rows = np.searchsorted(inside, begins[1:], side="right")
    rows = np.concatenate([[0], rows])
    shown = np.empty(inside.size)
    for k in np.flatnonzero(np.diff(rows)):
        own = slice(rows[k], rows[k + 1])
        shown[own] = pieces[k](inside[own] - begins[k])
    return shown


def _low_passed(pieces, begins, second, tau):
    """Low-pass of what is left when the jumps between steps are taken out, and of the jumps.

    Without its jumps the quantity is all but straight between neighbouring ages; a jump J answers
    with J (1 − exp(−t/τ)), whatever the sampling.
    """
    edge = begins[1:-1]
    jump = _jumps(pieces, np.diff(begins))
    risen = np.concatenate([[0.0], np.cumsum(jump)])
    past = second[:, None] - tau * AGE
    before = np.searchsorted(edge, past, side="left")
    order = np.argsort(past, axis=None, kind="stable")
    there = np.empty(past.size)
    there[order] = _at(pieces, begins, past.ravel()[order])
    smooth = (there.reshape(past.shape) - risen[before]) @ _weights()
    now = before[:, 0]
    pending, since = _pending(jump, edge, tau), np.append(0.0, edge)
    return smooth + risen[now] - pending[now] * np.exp(-(second - since[now]) / tau)


def _jumps(pieces, durations):
    """Step up of the quantity where one step follows another."""
    ends = [float(p(np.array([d]))[0]) for p, d in zip(pieces[:-1], durations[:-1], strict=True)]
    starts = [float(piece(np.zeros(1))[0]) for piece in pieces[1:]]
    return np.array(starts) - np.array(ends)


def _pending(jump, edge, tau):
    """What the low-pass still lacks right after each edge; nothing before the first."""
    lacking = [0.0]
    waits = np.diff(edge, prepend=edge[:1])
    for rise, kept in zip(jump, np.exp(-waits / tau), strict=True):
        lacking.append(rise + kept * lacking[-1])
    return np.array(lacking)


def _weights():
    """Integral of exp(−age) over the hat of each age; they sum to one."""
    left, right = AGE[:-1], AGE[1:]
    whole = np.exp(-left) - np.exp(-right)
    late = whole / (right - left) - np.exp(-right)
    weights = np.append(whole - late, 0.0) + np.append(0.0, late)
    weights[-1] += np.exp(-AGE[-1])
    return weights
