"""Cells in parallel: what each branch of a group did."""

from collections.abc import Sequence

import numpy as np

from virtual_lab.truth.charges import NEAR_VOLT, grid


def group_rows(
    steps: list,
    behaviours: list,
    *,
    names: Sequence[str],
    capacities_ampere_hour: Sequence[float | None],
) -> list[dict]:
    """Shares of a group's branches; rows of packs.csv without group and test.

    Parameters
    ----------
    steps, behaviours : of the test; each behaviour has a branch per name.
    names : cells in the order of the branches.
    capacities_ampere_hour : of these cells, alone [Ah].

    Returns
    -------
    One row a branch: `capacity_ampere_hour` of its cell; `charge_ampere_hour`, what flowed out of
    it, net, while the group was discharged; `current_max_ampere`, its largest current of either
    direction; `group_capacity_ampere_hour`, what the whole group gave in a discharge of constant
    current to its cut-off (the largest; blank where there was none).
    """
    nets = [_net(behaviour.current, behaviour) for behaviour in behaviours]
    down = [b for b, net in zip(behaviours, nets, strict=True) if net < -1e-6]
    whole = zip(steps, behaviours, nets, strict=True)
    group = [-net for step, b, net in whole if net < 0 and _ended_empty(step, b)]
    rows = []
    for branch, (name, capacity) in enumerate(zip(names, capacities_ampere_hour, strict=True)):
        charge = sum(-_net(behaviour.branches[branch], behaviour) for behaviour in down)
        largest = max(_largest(behaviour, branch) for behaviour in behaviours)
        rows.append(
            {
                "branch": branch + 1,
                "cell": name,
                "capacity_ampere_hour": None if capacity is None else round(float(capacity), 6),
                "charge_ampere_hour": round(charge, 6),
                "current_max_ampere": round(largest, 6),
                "group_capacity_ampere_hour": round(max(group), 6) if group else None,
            }
        )
    return rows


def _ended_empty(step, behaviour) -> bool:
    if step.kind != "current" or step.until_volt is None:
        return False
    end = float(behaviour.voltage(behaviour.duration_second))
    return abs(end - step.until_volt) < NEAR_VOLT


def _net(current, behaviour) -> float:
    """Charge [Ah] of a current over a step."""
    second = grid(behaviour.duration_second)
    return float(np.trapezoid(current(second), second) / 3600)


def _largest(behaviour, branch) -> float:
    return float(np.abs(behaviour.branches[branch](grid(behaviour.duration_second))).max())
