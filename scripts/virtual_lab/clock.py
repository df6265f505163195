"""When an instrument takes its samples.

Three clocks. "late": where 0.5 s was asked, samples lie 0.51 to 0.58 s apart (thesis 4.4), and a
step is sampled densely where it begins. "jittery": a sample lies up to 80 ms beside its place on a
regular grid, the first one 60 ms after the step began. "steady": on the grid to 4 ms, with no
sample where the step begins (as the Digatron's of the LG HG2 data).
"""

import numpy as np

EARLY_SECOND = np.array([0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0])
LATE_SECOND = (0.01, 0.08)
JITTER_SECOND = 0.08
STEADY_SECOND = 0.004
FIRST_SECOND = 0.06
MOST_OF_A_PERIOD = 0.2


def sample_times(
    duration_second: float,
    *,
    period_second: float,
    random: np.random.Generator,
    clock: str = "late",
) -> np.ndarray:
    """Instants [s] from the start of a step at which the instrument takes a sample.

    The last one is the end of the step. `period_second` [s] is what was asked; `clock` is "late",
    "jittery" or "steady".
    """
    times = {"late": _late, "jittery": _jittery, "steady": _steady}[clock]
    inside = times(duration_second, period_second, random)
    return np.round(np.concatenate([inside, [duration_second]]), 3)


def _late(duration, period, random):
    """Dense right after the step began, then late by 10 to 80 ms each time."""
    early = np.array([s for s in EARLY_SECOND if s < 0.99 * min(period, duration)])
    most = int(duration / period) + 1
    waits = period + random.uniform(*LATE_SECOND, most)
    regular = early[-1] + np.cumsum(waits) if early.size else np.cumsum(waits)
    return np.concatenate([early, regular[regular < duration - 0.5 * min(period, 1.0)]])


def _jittery(duration, period, random):
    """Around a regular grid, the first soon after the step began."""
    first = min(FIRST_SECOND, MOST_OF_A_PERIOD * min(period, duration))
    return np.append(first, _beside_grid(duration, period, random, JITTER_SECOND))


def _steady(duration, period, random):
    return _beside_grid(duration, period, random, STEADY_SECOND)


def _beside_grid(duration, period, random, most):
    place = np.arange(1, int(duration / period) + 1) * period
    most = min(most, MOST_OF_A_PERIOD * period)
    regular = place + random.uniform(-most, most, place.size)
    return regular[regular < duration - most]
