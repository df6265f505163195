"""What data excite: an effect whose factor they do not move cannot be told."""

import numpy as np

from cellwright.effects.records import LOADED_C_RATE

KELVIN = 5.0
SOC_RANGE = 0.3
REST_SECOND = 540.0
RATE_RATIO = 2.0
BOTH_SHARE = 0.02
EDGES = 20
SAMPLING_SECOND = 2.0


def _temperature(stack, capacity):
    means = [stack.celsius[stack.file == k].mean() for k in range(len(stack.first))]
    return np.ptp(means) >= KELVIN


def _both(stack, capacity):
    loads = np.abs(stack.current_ampere) * stack.step_second
    total = loads.sum()
    charging = loads[stack.current_ampere > 0].sum()
    return total > 0 and min(charging, total - charging) / total >= BOTH_SHARE


def _soc_range(stack, capacity):
    moved = stack.held_ampere * stack.step_second / 3600.0 / capacity
    spans = [np.ptp(np.cumsum(moved[stack.file == k])) for k in range(len(stack.first))]
    starts = stack.soc_at_start
    return max(spans) >= SOC_RANGE or np.ptp(starts) >= SOC_RANGE


def _rates(stack, capacity):
    loads = np.abs(stack.current_ampere)
    loads = loads[loads > LOADED_C_RATE * capacity]
    low, high = np.percentile(loads, [10, 95]) if len(loads) else (1.0, 1.0)
    return high / low >= RATE_RATIO


def _long_rest(stack, capacity):
    rest = np.abs(stack.current_ampere) <= LOADED_C_RATE * capacity
    edges = np.flatnonzero(np.diff(np.r_[0, rest & (stack.fresh == 0), 0]))
    clock = np.cumsum(stack.step_second)
    lasting = [clock[end - 1] - clock[begin] for begin, end in edges.reshape(-1, 2)]
    return max(lasting, default=0.0) >= REST_SECOND


def _edges(stack, capacity):
    step = np.abs(np.diff(stack.current_ampere, prepend=stack.current_ampere[0]))
    sharp = (step > 0.2 * capacity) & (stack.fresh == 0) & (stack.step_second <= SAMPLING_SECOND)
    return sharp.sum() >= EDGES


FACTORS = {
    "temperature": (_temperature, f"mean temperatures of the records {KELVIN:g} K apart"),
    "both_directions": (_both, "charge and discharge within the records"),
    "soc_range": (_soc_range, f"{100 * SOC_RANGE:g} % of the state of charge"),
    "rates": (_rates, f"loads that differ by a factor of {RATE_RATIO:g}"),
    "long_rest": (_long_rest, f"a rest of {REST_SECOND / 60:g} min"),
    "edges": (_edges, f"{EDGES} sharp steps of the current, sampled every {SAMPLING_SECOND:g} s"),
}


def lacking(effect, stack, capacity_ampere_hour):
    """What a stack of records does not excite of what an effect needs, in words; empty: nothing."""
    return tuple(
        FACTORS[name][1]
        for name in effect.needs
        if not FACTORS[name][0](stack, capacity_ampere_hour)
    )
