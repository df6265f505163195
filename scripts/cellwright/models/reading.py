"""What a plant's tables say at one SoC, for the filter in plain numpy."""

import numpy as np

from cellwright.models.bank import NODES
from cellwright.models.kernels import lag_weights
from cellwright.models.plant import GAIN, SLOPE, TOTAL

SPREAD = np.sqrt(3.0)  # of a chord, in standard deviations: that of a Gaussian's three-point rule


def slope_at(plant, soc, variance, noise):
    """Slope of the OCV over what is not known of the SoC, and what a chord misses in its middle."""
    reach = SPREAD * np.sqrt(variance)
    if reach <= noise.slope_window_soc / 2:
        return look_at(plant, soc)[SLOPE], 0.0
    low, high = max(soc - reach, min(soc, 0.0)), min(soc + reach, max(soc, 1.0))
    ends = [look_at(plant, z)[TOTAL] for z in (low, (low + high) / 2, high)]
    return (ends[2] - ends[0]) / (high - low), ends[1] - (ends[0] + ends[2]) / 2


def relaxation_at(plant, k, j, soc):
    """Decay of lag j over the step to sample k, and what the drive adds to it."""
    e = plant.element[j]
    column = GAIN + len(plant.direct) + j
    near = place_at(plant, soc + plant.soc_spacing / 2)[0] if plant.moves[j] else 0
    constant, now = plant.tables[near, column], drive_at(plant, e, k, soc)
    if plant.by_charge[e]:
        gain = -np.expm1(-plant.passed_ampere_hour[k] / constant)
        return 1.0 - gain, gain * now
    hold = "first_order" if plant.first_order else "zero_order"
    step = plant.step_second[k : k + 1]
    decay, before, after = (w[0] for w in lag_weights(step, constant, hold=hold))
    return decay, before * drive_at(plant, e, k - 1, soc) + after * now


def drive_at(plant, e, k, soc):
    """Drive of element e at sample k."""
    if plant.source[e] < 0:
        current = plant.between_ampere if plant.by_charge[e] else plant.current_ampere
        return current[k] * look_at(plant, soc)[GAIN + e]
    cells = len(NODES) - 1
    spot = min(max(soc, 0.0), 1.0) * cells
    i = min(int(spot), cells - 1)
    low, high = plant.drives[plant.source[e], k, i : i + 2]
    return low + (spot - i) * (high - low)


def look_at(plant, soc):
    """Row of the tables, straight between two points."""
    i, part = place_at(plant, soc)
    return plant.tables[i] + part * (plant.tables[i + 1] - plant.tables[i])


def place_at(plant, soc):
    """Cell of the tables, and where in it; beyond the ends on the last slope."""
    spot = (soc - plant.soc_first) / plant.soc_spacing
    i = int(min(max(spot, 0.0), len(plant.tables) - 2.0))
    return i, spot - i
