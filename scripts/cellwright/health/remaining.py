"""Cycles that remain until a share of the capacity is left, with an interval."""

import numpy as np

from cellwright.health.fade import LEAST_LOSS, LEVEL, courses, recovery

HORIZON = 6.0  # lives so far, up to which a course is carried forward
CYCLES = ("remaining_cycles", "remaining_lower_cycles", "remaining_upper_cycles")
CYCLES += ("end_of_life_cycle", "end_of_life_reached", "remaining_reason")


def remaining_of(fade, drawn, knee, *, end_of_life):
    """Cycles that remain until capacity is `end_of_life` of what it was at the start.

    Each law that the data allow is carried forward, in the place of one draw. What the law does
    not know is laid on it: the fade slows or quickens as a power of the cycle ratio, and as long
    as no knee was seen a knee may come, at a place without scale (as likely between n and 2n as
    beyond). Both widths are set so that intervals hold for made lives of many kinds
    (docs/health.md). Recovery after rests counts as on average over the first and the last third
    of the life: it comes and goes.

    Parameters
    ----------
    fade : fade.Fade. drawn : fade.Draws. knee : of `knee.knee_of`. end_of_life : share of the
    capacity by the course at the first cycle [1].

    Returns
    -------
    remaining : dict, columns of the row of artefact `life`. soh, soh_std : capacity at the last
        cycle over that at the start [1]. remaining_cycles, remaining_lower_cycles,
        remaining_upper_cycles : from the last cycle until the end of life, median and 95 %
        interval; NaN where not knowable (upper alone: beyond what can be carried forward).
        end_of_life_cycle : where it is, or was reached. end_of_life_reached : whether the life has
        reached it. remaining_reason : what is not known, and why.

    Source: the chance of a knee: J. R. Gott, Nature 363 (1993) 315 (no scale but the time so far);
    ratios: P. M. Attia et al., J. Electrochem. Soc. 169 (2022) 060517.
    """
    points = fade.points
    start, now, soh, soh_std = _state(fade, drawn)
    # Of each draw its own start: errors of start and end hang together.
    target = end_of_life * start
    last = float(points.cycle[-1])
    median = np.median(courses(drawn, points.share), axis=0) + recovery(fade)

    def row(cycles, end, reason="", *, reached=False):
        numbers = dict(zip(CYCLES, (*cycles, end, reached, reason), strict=True))
        return {"soh": soh, "soh_std": soh_std} | numbers

    unknown = [np.nan] * 3
    if np.mean(now <= target) > (1 + LEVEL) / 2:
        below = np.flatnonzero(median <= np.median(target))
        at = float(points.cycle[below[0]]) if len(below) else last
        return row([0.0] * 3, at, reached=True)
    lost = median.max() - np.median(now)
    if np.median(now) > median[0] + max(LEAST_LOSS, 2 * soh_std) / 2:
        words = f"capacity grows ({100 * (soh - 1):+.1f} %): no fade to carry forward"
        return row(unknown, np.nan, words)
    if lost < LEAST_LOSS:
        words = f"{100 * lost:.1f} % lost so far, less than {100 * LEAST_LOSS:g} %"
        return row(unknown, np.nan, f"{words}: remaining cycles are not knowable")
    crossing = _crossings(drawn, now, target, knee, np.random.default_rng(1))
    limits = [(1 - LEVEL) / 2, 0.5, (1 + LEVEL) / 2]
    low, middle, high = np.quantile(crossing, limits, method="inverted_cdf")
    cycles = [
        float(value * last) if np.isfinite(value) else np.nan for value in (middle, low, high)
    ]
    if np.isnan(cycles[0]):
        words = f"more than half of the laws do not get there within {HORIZON:g} lives so far"
        return row([np.nan, cycles[1], np.nan], np.nan, words)
    open_end = "" if np.isfinite(high) else f"no upper limit within {HORIZON:g} lives so far"
    return row(cycles, last + cycles[0], open_end)


def _state(fade, drawn):
    """Capacity at the start and now, over the scale, of each draw; state of health and its std."""
    start, end = courses(drawn, fade.points.share[[0, -1]]).T
    # Noise that remembers itself is where the cell is; noise that does not is the reading's.
    steps = np.diff(fade.points.place)
    carried = drawn.correlation ** float(np.median(steps))
    returned, third = recovery(fade), max(len(steps) // 3, 1)
    start = start + np.mean(returned[:third])
    now = end + carried * drawn.last + np.mean(returned[-third:])
    share = now / start
    return start, now, float(np.median(share)), float(np.std(share))


# ASSUME: Unless a knee has been seen, one may lie ahead: that none lies before cycle m has the
# chance n/m, n the cycles so far. The fade beyond it is 1.5 to 12 times as fast (log-uniform).
# ASSUME: The fade to come follows the law so far times (m/n)^d, d normal with deviation 0.35; the
# square root law lies at −0.5 from the straight one.
def _crossings(drawn, now, target, knee, random):
    """Share of the life so far after which each draw falls below the target; inf: never."""
    count = len(now)
    ratio = np.geomspace(1.0, HORIZON, 240)
    ahead = courses(drawn, ratio)
    steps = -np.diff(ahead, axis=1)
    middle = np.sqrt(ratio[1:] * ratio[:-1])
    # A law that bends upwards would have the capacity come back: at most it slows as 1/cycle.
    pace = steps[:, :1] / (ratio[1] - ratio[0])
    slowest = pace * (np.diff(ratio) / middle)[None, :]
    steps = np.where(pace > 0, np.maximum(steps, slowest), steps)
    slope = random.normal(0.0, 0.35, count)
    # A power of the cycle ratio: the law of the past holds less the further ahead.
    steps = steps * middle[None, :] ** slope[:, None]
    if np.isnan(knee["knee_cycle"]):
        place = 1 / random.uniform(0.0, 1.0, count)
        faster = np.exp(random.uniform(*np.log((1.5, 12.0)), count))
        steps = steps * np.where(middle[None, :] > place[:, None], faster[:, None], 1.0)
    level = now[:, None] - np.cumsum(steps, axis=1)
    below = level <= target[:, None]
    first = np.argmax(below, axis=1)
    crossing = np.where(below.any(axis=1), ratio[1:][first] - 1, np.inf)
    return np.where(now <= target, 0.0, crossing)
