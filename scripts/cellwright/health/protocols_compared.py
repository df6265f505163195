"""Ageing protocols compared: does one wear cells out faster, beyond what cells differ by?"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.health.fade import LEAST_LOSS
from cellwright.health.table import summary_and_columns
from cellwright.laws.points import grouped
from cellwright.refusal import Refusal
from cellwright.result import Result


class LifeOfProtocol(NamedTuple):
    """A life under a protocol: cell, protocol, (n,) cycle and (n,) capacity over the start [1]."""

    cell: str
    protocol: str
    cycle: np.ndarray
    share: np.ndarray


def compare_protocols(lives):
    """Ageing protocols of one type of cells compared pair by pair, beyond what cells differ by.

    lives : (cell, protocol, result of `fade` or a pair (summary, columns)) each.

    Returns rows, one a pair of protocols. Raises Refusal: fewer than two protocols,
    or a life that has hardly faded. Source: docs/health.md.
    """
    ready = []
    for cell, protocol, fade in lives:
        summary, columns = summary_and_columns(fade)
        # Laws instead of points: a scattered discharge must not decide how long a protocol lasts.
        share = np.asarray(columns["law_ampere_hour"], float) / summary["start_ampere_hour"]
        ready.append(LifeOfProtocol(cell, protocol, np.asarray(columns["cycle"], float), share))
    return Result({"rows": compared(ready)})


def compared(lives):
    """Protocols of one cell type compared pair by pair.

    1. All lives are compared at one loss: the largest that each of them has reached, at most
    20 %. 2. ln(cycles until then) of a cell is its protocol's mean plus what cells of one protocol
    differ by (a hierarchy of cells within protocols). That spread is estimated from all
    protocols that have several cells, together. 3. A pair differs where Student's t, with as
    many degrees of freedom as that spread has, says so after Holm's correction for the number of
    pairs. With one cell under each protocol the spread is not known, and nothing can be told.

    Parameters
    ----------
    lives : list of LifeOfProtocol, one type of cells.

    Returns
    -------
    comparisons : list of dict as of `tables/protocols`: ratio and its limits are NaN where the
        spread of cells is not known.

    Raises
    ------
    Refusal : fewer than two protocols; a life that has not lost 2 %.

    Source: S. Holm, Scand. J. Statist. 6 (1979) 65; thesis 4.3 (standard, high power, fast charge).
    """
    arms = grouped(lives, lambda life: life.protocol)
    if len(arms) < 2:
        raise Refusal(f"one protocol only ({', '.join(arms) or 'none stated'}): nothing to compare")
    least = min(lives, key=lambda life: 1 - life.share.min())
    loss = min(1 - float(least.share.min()), 0.2)
    if loss < LEAST_LOSS:
        raise Refusal(
            f"{least.cell} has lost {100 * loss:.1f} %; lives are compared from "
            f"{100 * LEAST_LOSS:g} % on"
        )
    logs = {name: np.array([_log_cycles(one, loss) for one in arms[name]]) for name in arms}
    squares = sum(np.sum((values - values.mean()) ** 2) for values in logs.values())
    freedom = sum(len(values) - 1 for values in logs.values())
    # One spread for all protocols: each alone has too few cells to tell its own.
    spread = np.sqrt(squares / freedom) if freedom else np.nan
    pairs = list(combinations(sorted(arms), 2))
    chances = _holm([_chance(logs[a], logs[b], spread, freedom) for a, b in pairs])
    return [
        _comparison(a, b, logs, loss, spread, freedom, chance)
        for (a, b), chance in zip(pairs, chances, strict=True)
    ]


def _log_cycles(life, loss):
    """ln of the cycles until a loss: where the course last lies above it."""
    # Where it last lies above: a rest may lift a life over the loss again.
    above = np.flatnonzero(life.share > 1 - loss)
    last = int(above[-1]) if len(above) else 0
    if last + 1 >= len(life.cycle):
        return float(np.log(life.cycle[-1]))
    high, low = life.share[last], life.share[last + 1]
    part = (high - (1 - loss)) / (high - low) if high > low else 1.0
    at = life.cycle[last] + part * (life.cycle[last + 1] - life.cycle[last])
    return float(np.log(max(at, 1e-9)))


def _standard_error(first, second, spread):
    return spread * np.sqrt(1 / len(first) + 1 / len(second))


def _chance(first, second, spread, freedom):
    """Two-sided chance of so large a difference of means; NaN without a known spread."""
    from scipy.stats import t as student

    if not freedom:
        return np.nan
    error = max(_standard_error(first, second, spread), 1e-12)
    return float(2 * student.sf(abs(first.mean() - second.mean()) / error, freedom))


def _holm(chances):
    """Chances corrected for how many were looked at (Holm's step-down)."""
    order = np.argsort(chances)
    corrected, highest = np.full(len(chances), np.nan), 0.0
    for rank, place in enumerate(order):
        if np.isfinite(chances[place]):
            highest = max(highest, min(chances[place] * (len(chances) - rank), 1.0))
            corrected[place] = highest
    return corrected


def _comparison(a, b, logs, loss, spread, freedom, chance):
    """One pair of protocols in numbers and words."""
    from scipy.stats import t as student

    first, second = logs[a], logs[b]
    difference = second.mean() - first.mean()
    width = (
        student.ppf(0.975, freedom) * _standard_error(first, second, spread) if freedom else np.nan
    )
    ratio, low, high = np.exp([difference, difference - width, difference + width])
    if not freedom:
        verdict = "cannot be told from cell-to-cell spread: one cell under each protocol"
    elif chance < 0.05:
        sooner, later = (a, b) if difference > 0 else (b, a)
        factor = max(ratio, 1 / ratio)
        verdict = f"{sooner} wears cells out {factor:.2g} times as fast as {later}"
    else:
        verdict = "no difference beyond cell-to-cell spread"
    return {
        "first": a,
        "second": b,
        "cells_first": len(first),
        "cells_second": len(second),
        "loss": float(loss),
        "cycles_first": float(np.exp(first.mean())),
        "cycles_second": float(np.exp(second.mean())),
        "ratio": float(ratio),
        "ratio_lower": float(low),
        "ratio_upper": float(high),
        "cell_spread": float(spread),
        "chance": float(chance),
        "verdict": verdict,
    }
