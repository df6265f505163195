"""Resistances: what a step of the current does to the voltage, some time later."""

from itertools import pairwise

import numpy as np

from virtual_lab.truth.charges import soc_at_begins

DELAYS_SECOND = (0.0, 1.0, 10.0, 30.0)
FIRST_SECOND = 0.010  # where the first sample of a pulse lies
LONGEST_SECOND = 120.0  # a longer load is no pulse


def resistance_rows(
    steps: list,
    behaviours: list,
    *,
    capacity_ampere_hour: float,
    initial_soc: float = 1.0,
    delays_second: tuple[float, ...] = DELAYS_SECOND,
) -> list[dict]:
    """Resistance of each pulse: constant current for at most two minutes, after another current.

    Its step of the current is counted from the current before it: zero after a rest, that of the
    discharge where the pulse interrupts one. Delay 0 is 10 ms after the edge.

    Parameters
    ----------
    steps, behaviours : what was asked and what happened.
    capacity_ampere_hour : of the full cell [Ah], to which the state of charge refers.
    initial_soc : at the start [1].
    delays_second : after the edge [s]; those after the pulse's end are left out.

    Returns
    -------
    Rows of resistance.csv without cell and test.
    """
    soc = soc_at_begins(behaviours, capacity_ampere_hour, initial_soc)
    begins = np.cumsum([0.0, *[round(b.duration_second, 3) for b in behaviours]])
    rows = []
    for k, (before, pulse) in enumerate(pairwise(range(len(steps))), 1):
        if is_pulse(steps[before], steps[pulse]):
            shared = {"soc": round(float(soc[k]), 6), "start_time_second": round(begins[k], 3)}
            rows += _pulse_rows(behaviours[before], behaviours[pulse], delays_second, shared)
    return rows


def is_pulse(before, step) -> bool:
    """Whether a step is a pulse after the step before it."""
    constant = step.kind == before.kind == "current"
    short = step.duration_second <= LONGEST_SECOND
    return constant and short and abs(step.value) > abs(before.value)


def _pulse_rows(before, pulse, delays, shared) -> list[dict]:
    end = before.duration_second
    volt, ampere = float(before.voltage(end)), float(before.current(end))
    reached = [d for d in delays if max(d, FIRST_SECOND) <= pulse.duration_second + 1e-3]
    rows = []
    for delay in reached:
        second = min(max(delay, FIRST_SECOND), pulse.duration_second)
        change = float(pulse.current(second)) - ampere
        rows.append(
            {
                "soc": shared["soc"],
                "direction": "charge" if change > 0 else "discharge",
                "start_time_second": float(shared["start_time_second"]),
                "delay_second": delay,
                "resistance_ohm": float(f"{(float(pulse.voltage(second)) - volt) / change:.6g}"),
            }
        )
    return rows
