"""What kind of test a record could be, from its steps alone: a proposal for the sheet of tests."""

from collections.abc import Mapping

import numpy as np

from cellwright.records.anchor import RELAXED_SECOND
from cellwright.records.conditions import SAME_CELSIUS

STEADY = ("CC", "CV", "CCCV")
FULL_SHARE = 0.9  # of the largest half cycle, from which another counts as full too
DYNAMIC_SHARE = 0.3  # of the loaded time: a drive cycle between a charge and rests
OCV_C_RATE = 1 / 14  # C/15 and slower, with what a capacity may be off its rating
ICA_C_RATE = 1 / 4  # above, the peaks of dQ/dV run into each other
MANY_HALF_CYCLES = 10
MANY_PULSES = 3
FEW_HALF_CYCLES = 3  # of one direction, of which the largest is a whole one
LEAST_SPAN = 0.3  # of the capacity, over which pulses are a characterisation over SoC


def half_cycles(steps: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Charge [Ah] and rate-free current [A] of each half cycle: loads of one sign in a row.

    Rests and loads too small to turn the direction do not end one.

    Returns
    -------
    charge, current : arrays (half cycles,), signed; current is the mean weighted by the charge.
    """
    steady = np.isin(steps["kind"], STEADY) & (steps["charge_ampere_hour"] != 0)
    charge, current = steps["charge_ampere_hour"][steady], steps["current_mean_ampere"][steady]
    if not len(charge):
        return np.zeros(0), np.zeros(0)
    starts = np.flatnonzero(np.diff(np.sign(charge), prepend=0.0))
    moved = np.add.reduceat(charge, starts)
    weighted = np.add.reduceat(np.abs(charge) * current, starts) / np.abs(moved)
    return moved, weighted


def whole_charge(moved: np.ndarray) -> float:
    """Charge [Ah] of a whole half cycle, from those of a record (half cycles,), signed.

    The largest; of several in each direction that of the direction that moves less, for where a
    half cycle was not logged, two of the other sign are joined.
    """
    sides = [np.abs(moved[side]) for side in (moved > 0, moved < 0)]
    several = min(map(len, sides)) >= FEW_HALF_CYCLES
    return float(min(map(max, sides)) if several else np.abs(moved).max(initial=0.0))


def likely_kinds(steps: Mapping[str, np.ndarray], *, celsius_span: float = 0.0) -> list[tuple]:
    """Kinds of test that a record could be, the likeliest first, each with its reason in words.

    Parameters
    ----------
    steps : columns of `series.steps.Steps`, (k,) each.
    celsius_span : of the temperatures in the record [K].

    Returns
    -------
    list of (kind as in tests.tsv, reason); empty where the record fits none.
    """
    kind, duration = steps["kind"], steps["duration_second"]
    loaded = duration[kind != "rest"].sum()
    moved, current = half_cycles(steps)
    capacity = whole_charge(moved)
    found = []
    dynamic = duration[kind == "dynamic"].sum()
    if loaded and dynamic >= DYNAMIC_SHARE * loaded:
        found.append(("drive", f"{dynamic / loaded:.0%} of its load is dynamic"))
    pulses = int(np.count_nonzero(kind == "pulse"))
    if pulses >= MANY_PULSES and _span(steps, "pulse") >= LEAST_SPAN * capacity > 0:
        found.append(("hppc", f"{pulses} pulses over {_span(steps, 'pulse'):.3g} Ah"))
    parts = _titration(steps, capacity)
    if parts and not found:
        found.append(("hppc", f"{parts} parts of a charge or discharge, each with a long rest"))
    full = np.abs(moved) >= FULL_SHARE * capacity
    if not found and capacity > 0:
        found += _of_cycles(moved[full], np.abs(current[full]) / capacity)
    if pulses and not any(name == "hppc" for name, _ in found):
        found.append(("pulse_resistance", f"{pulses} pulses"))
    if not found and not loaded:
        warm = celsius_span > 2 * SAME_CELSIUS
        name = "ocv_temperature" if warm else "relaxation"
        found.append((name, f"nothing but rest{' while the temperature changes' if warm else ''}"))
    return found


def _of_cycles(charge, rate):
    """Kinds of a record of whole charges and discharges: charges [Ah] and rates [1/h]."""
    found = []
    if len(charge) >= MANY_HALF_CYCLES:
        found.append(("ageing", f"{len(charge) // 2} full cycles"))
    slow = rate <= OCV_C_RATE
    if slow.any():
        found.append(("ocv", f"a full half cycle at C/{1 / rate.min():.0f}"))
    if len(charge):
        found.append(
            ("capacity", f"{len(charge)} full half cycles, largest {max(abs(charge)):.4g} Ah")
        )
    charging = (charge > 0) & (rate <= ICA_C_RATE)
    if charging.any():
        found.append(("ica", f"a full charge at C/{1 / rate[charging].min():.0f}"))
    return found


def _span(steps, kind):
    """Charge [Ah] between the first and the last step of a kind, and the widest in between."""
    net = np.cumsum(steps["charge_ampere_hour"])
    return float(np.ptp(net[steps["kind"] == kind])) if np.any(steps["kind"] == kind) else 0.0


def _titration(steps, capacity):
    """Number of steady loads of less than a quarter of the capacity, each before a long rest."""
    kind, charge = steps["kind"], np.abs(steps["charge_ampere_hour"])
    part = np.isin(kind[:-1], STEADY) & (charge[:-1] < 0.25 * capacity)
    rested = (kind[1:] == "rest") & (steps["duration_second"][1:] >= RELAXED_SECOND)
    number = int(np.count_nonzero(part & rested))
    return number if number >= 8 else 0
