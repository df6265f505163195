"""How cells in parallel share a discharge: what the group gives, peaks, spread, safe window."""

from typing import NamedTuple

import numpy as np

from cellwright.packs.parallel import Group, simulate_parallel
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
STEPS = 400
BEYOND = 1.05  # of the group's charge: so far a discharge is simulated


class GroupUse(NamedTuple):
    """A constant-current discharge of a parallel group to its cut-off.

    capacity_ampere_hour, energy_watt_hour : of the group. cells_ampere_hour : sum of its cells'
    capacities. group_soc : (n,) of the group by its charge [1]. branch_share : (n, cells) current
    of each branch over its share of the total by capacity; 1 is ideal. peak_share : the largest.
    loss_watt : (cells,) mean heat of each cell and its wire.
    """

    capacity_ampere_hour: float
    energy_watt_hour: float
    cells_ampere_hour: float
    group_soc: np.ndarray
    branch_share: np.ndarray
    peak_share: float
    loss_watt: np.ndarray


def cells_from(group, index):
    """Some cells of a Group, in the order of `index`, as a Group."""
    return Group(*(table[list(index)] for table in group))


def discharge_group(
    group,
    *,
    lower_cutoff_volt,
    c_rate=SETTINGS.group_c_rate,
    initial_soc=1.0,
    wire_resistance_ohm=0.0,
):
    """Discharge cells in parallel from rest to the group's cut-off at a constant current.

    Parameters
    ----------
    group : parallel.Group. lower_cutoff_volt : of the group [V].
    c_rate : of the current, over the sum of the cells' capacities [1/h].
    initial_soc, wire_resistance_ohm : scalars or (cells,) [1], [ohm].

    Returns
    -------
    use : GroupUse.

    Raises
    ------
    Refusal : the cut-off is not reached, or as `parallel.simulate_parallel`.
    """
    whole = float(group.capacity_ampere_hour.sum())
    time = np.linspace(0.0, BEYOND * 3600.0 / c_rate, STEPS + 1)
    run = simulate_parallel(
        time,
        np.full(len(time), -c_rate * whole),
        group,
        initial_soc=initial_soc,
        wire_resistance_ohm=wire_resistance_ohm,
    )
    below = np.flatnonzero(run.voltage_volt <= lower_cutoff_volt)
    if not len(below):
        found = f"ends at {run.voltage_volt[-1]:.3f} V"
        raise Refusal(f"the group does not fall to its cut-off of {lower_cutoff_volt:g} V: {found}")
    # The first sample is the instant at which the load is joined.
    end = max(int(below[0]), 2)
    volt = run.voltage_volt[: end + 1]
    share = (volt[-2] - lower_cutoff_volt) / (volt[-2] - volt[-1])
    stop = time[end - 1] + np.clip(share, 0.0, 1.0) * (time[end] - time[end - 1])
    second = np.append(time[:end], stop)
    hour = second / 3600.0
    volt = np.interp(second, time, run.voltage_volt)
    current = np.array(
        [np.interp(second, time, branch) for branch in run.branch_current_ampere.T]
    ).T
    ideal = -c_rate * group.capacity_ampere_hour
    shares = current[1:] / ideal
    return GroupUse(
        float(c_rate * whole * hour[-1]),
        float(c_rate * whole * np.trapezoid(volt, hour)),
        whole,
        1.0 - c_rate * hour[1:],
        shares,
        float(shares.max()),
        (current[1:] ** 2).mean(axis=0) * _resistance(group, wire_resistance_ohm),
    )


def _resistance(group, wire_ohm):
    """Resistance of each cell in the long run and its wire, mean over SoC (cells,) [ohm]."""
    return (group.r0_ohm + group.r_ohm.sum(axis=1)).mean(axis=1) + wire_ohm


class Window(NamedTuple):
    """Range of a group's SoC in which its currents stay within a spread.

    lower_soc, upper_soc : NaN where there is none. charge_share : of the group's charge [1].
    spread : the largest in it [1]. worst_spread, worst_soc : the largest of all, and where.
    """

    lower_soc: float
    upper_soc: float
    charge_share: float
    spread: float
    worst_spread: float
    worst_soc: float


def safe_window(use, *, current_spread=SETTINGS.current_spread):
    """The widest range of SoC in which no branch strays from its share by more than a limit.

    Parameters
    ----------
    use : GroupUse. current_spread : largest |share − 1| of a branch, its current over that by
        capacity [1].

    Returns
    -------
    window : Window.

    Source: thesis 5.2: 125 to 130 % of the ideal current below 15 % SoC, keep out of the last 10 to
    15 %.
    """
    spread = np.abs(use.branch_share - 1.0).max(axis=1)
    soc, worst = use.group_soc, int(np.argmax(spread))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], spread <= current_spread, [0]])))
    if not len(edges):
        return Window(np.nan, np.nan, 0.0, np.nan, float(spread[worst]), float(soc[worst]))
    begins, ends = edges[::2], edges[1::2] - 1
    widest = int(np.argmax(soc[begins] - soc[ends]))
    begin, end = begins[widest], ends[widest]
    inside = float(spread[begin : end + 1].max())
    width = float(soc[begin] - soc[end])
    limits = (float(soc[end]), float(soc[begin]), width, inside)
    return Window(*limits, float(spread[worst]), float(soc[worst]))
