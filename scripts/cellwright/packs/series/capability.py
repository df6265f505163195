"""What a series pack can give: charge, energy, balancing, and which cell limits them."""

from typing import NamedTuple

import numpy as np

from cellwright.packs.compare import discharging, passed_ampere_hour
from cellwright.packs.series.power import power_of_string
from cellwright.packs.series.string import (
    contact_of,
    logged,
    simulate_string,
    validate_string,
)
from cellwright.records.conditions import at_rest_in_record
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
BEYOND = 1.05  # a discharge is followed this much further than the largest cell holds


class Discharge(NamedTuple):
    """A constant-current discharge of a string until its first cell is at its lower cut-off.

    capacity_ampere_hour, energy_watt_hour : of the string. weakest : index of the cell that ends
    it. end_ampere_hour : (cells,) charge at which each cell alone would be empty.
    voltage_at_end_volt, soc_at_end : (cells,) when the string has ended.
    """

    capacity_ampere_hour: float
    energy_watt_hour: float
    weakest: int
    end_ampere_hour: np.ndarray
    voltage_at_end_volt: np.ndarray
    soc_at_end: np.ndarray


def discharge_string(
    models, *, lower_cutoff_volt, current_ampere, initial_soc, celsius=25.0, contact_ohm=0.0
):
    """Discharge a rested string at a constant current until the first cell is empty: Discharge.

    The string gives no more than its first cell to be empty, at its cut-off or at SoC 0 of its
    model: the shortest stave of the barrel. The other cells are followed to their own ends, which
    says by how much they would have lasted longer.

    Parameters
    ----------
    models : model dicts in the order of the string.
    lower_cutoff_volt : scalar or (cells,) [V]. current_ampere : > 0 [A].
    initial_soc : scalar or (cells,) [1]. celsius : of all cells [degC].
    contact_ohm : of all contacts of the string together [ohm].

    Raises
    ------
    Refusal : as `string.simulate_string`.
    """
    ends = {"lower_cutoff_volt": lower_cutoff_volt, "current_ampere": current_ampere}
    curves = discharge_curves(models, initial_soc=initial_soc, celsius=celsius, **ends)
    return ended_string(curves, contact_volt=contact_ohm * current_ampere)


class Curves(NamedTuple):
    """Cells discharged one by one at one current: charge [Ah] (n,), voltage [V] and SoC (n, cells),
    charge at which each is empty (cells,) [Ah]."""

    charge_ampere_hour: np.ndarray
    cell_voltage_volt: np.ndarray
    soc: np.ndarray
    end_ampere_hour: np.ndarray


def discharge_curves(models, *, lower_cutoff_volt, current_ampere, initial_soc, celsius=25.0):
    """Each cell of a string followed to its own cut-off: Curves, of arguments as above."""
    cells = len(models)
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    start = np.broadcast_to(np.asarray(initial_soc, float), (cells,))
    longest = BEYOND * float((start * capacity).max())
    charge = np.linspace(0.0, longest, int(BEYOND * 500) + 1)  # 500 steps of the largest cell
    second = 3600.0 * charge / current_ampere
    load = np.full(len(second), -float(current_ampere))
    at = {"initial_soc": start, "temperature_celsius": celsius, "hold": "zero_order"}
    run = simulate_string(models, second, load, **at)
    cutoff = np.broadcast_to(np.asarray(lower_cutoff_volt, float), (cells,))
    pairs = zip(run.cell_voltage_volt.T, cutoff, strict=True)
    at_cutoff = np.array([first_crossing(charge, volt, limit) for volt, limit in pairs])
    # ASSUME: A cell is empty at its cut-off or at SoC 0 of its model, whichever comes first: beyond
    # SoC 0 nothing was measured.
    ends = np.fmin(at_cutoff, start * capacity)
    return Curves(charge, run.cell_voltage_volt, run.soc, ends)


def first_crossing(charge, volt, limit):
    """Charge at which a falling voltage meets a limit, linear between samples; NaN where never.

    Parameters
    ----------
    charge : (n,). volt : (n,) or (n, curves). limit : scalar [V]. A voltage below the limit at the
        start gives 0.

    Returns
    -------
    charge : scalar or (curves,), as `charge`.
    """
    below = volt <= limit
    k = np.expand_dims(below.argmax(axis=0), 0)
    before = np.maximum(k - 1, 0)
    high, low = (np.take_along_axis(volt, at, axis=0) for at in (before, k))
    share = np.divide(high - limit, high - low, out=np.zeros_like(high), where=high > low)
    met = np.where(k > 0, charge[before] + share * (charge[k] - charge[before]), 0.0)
    return np.where(below.any(axis=0), met[0], np.nan)[()]


def ended_string(curves, items=slice(None), *, contact_volt=0.0):
    """The discharge of a string, which ends when its first cell is at its cut-off: Discharge.

    Parameters
    ----------
    curves : Curves. items : indices of the cells that make up the string.
    contact_volt : over all contacts together [V].
    """
    charge, ends = curves.charge_ampere_hour, curves.end_ampere_hour[items]
    weakest = int(np.nanargmin(ends))
    end = ends[weakest]
    kept = charge < end
    volt, soc = curves.cell_voltage_volt[:, items], curves.soc[:, items]
    at_end = [np.array([np.interp(end, charge, column) for column in of.T]) for of in (volt, soc)]
    whole = np.vstack([volt[kept], at_end[0]]).sum(axis=1) - contact_volt
    energy = np.trapezoid(whole, np.append(charge[kept], end))
    return Discharge(float(end), float(energy), weakest, ends, *at_end)


class Balance(NamedTuple):
    """What balancing asks for and brings; every array over the cells.

    top_ampere_hour : to be taken out of each cell, so that all are full at once.
    bottom_ampere_hour : to be taken out of each, so that all are empty at once.
    as_it_is, balanced_at_top, balanced_at_bottom : Discharge of the string charged until its first
    cell is full. level_ampere_hour : what the string would give if charge could be moved between
    its cells freely while it is used.
    """

    top_ampere_hour: np.ndarray
    bottom_ampere_hour: np.ndarray
    as_it_is: Discharge
    balanced_at_top: Discharge
    balanced_at_bottom: Discharge
    level_ampere_hour: float


def balance_string(models, *, initial_soc, **discharge):
    """Balancing of a string: the charge to take out of each cell, and what that would bring.

    A string is charged until its first cell is full and discharged until its first is empty. With
    cell k lacking C_k to full and holding D_k to empty, that gives min C + min D. Balanced by
    bleeding, at the top or at the bottom, the same cell is first at both ends, and it gives
    min(C + D), the smallest cell; no bleeding gives more. What lies above it needs charge to be
    moved: at best the mean of C + D.

    Parameters
    ----------
    models : model dicts. initial_soc : at any one moment at rest, scalar or (cells,) [1].
    discharge : lower_cutoff_volt, current_ampere, celsius, contact_ohm of `discharge_string`.

    Returns
    -------
    balance : Balance.
    """
    # ASSUME: A cell is full at SoC 1: the string's charge ends with a held voltage or a small
    # current.
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    soc = np.broadcast_to(np.asarray(initial_soc, float), capacity.shape)
    lacking = (1.0 - soc) * capacity

    def from_soc(start):
        return discharge_string(models, initial_soc=start, **discharge)

    charged = soc + lacking.min() / capacity
    as_it_is, at_top = from_soc(charged), from_soc(1.0)
    whole = at_top.end_ampere_hour
    # Bled at the bottom: what each holds more than the smallest is taken out before.
    surplus = whole - np.nanmin(whole)
    at_bottom = from_soc(1.0 - np.nan_to_num(surplus) / capacity)
    given = as_it_is.end_ampere_hour
    return Balance(
        lacking.max() - lacking,
        given - np.nanmin(given),
        as_it_is,
        at_top,
        at_bottom,
        float(np.mean(whole)),
    )


def series_pack(models, positions, cells, record, settings=SETTINGS):
    """A series pack through a record; its usable charge, energy, power, limits and balancing.

    1. The record is simulated and scored (`string.validate_string`). 2. From the SoC of its start
    the string is charged until its first cell is full, and discharged until its first is empty: at
    the record's own current where that ends so, else at `settings.c_rate`. 3. Power over that
    discharge, balancing, the end of discharge of each cell.

    Parameters
    ----------
    models : model dicts in the order of the string. positions : BranchFacts, in the same order.
    cells : CellFacts, likewise. record : Record of a group. settings : PackDecisions.

    Returns
    -------
    tables : dict: rows "cells", "pack" (one), "power", "waterfall"; columns "series".
    notes : list of sentences.

    Raises
    ------
    Refusal : a cell without cut-offs, or as `string.validate_string` and `discharge_string`.
    """
    lower, upper = cutoffs_of(cells)
    tables, notes = validate_string(models, positions, record)
    names = [row.cell for row in positions]
    start = np.array([row["soc_start"] for row in tables["cells"]])
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    ended = _measured_discharge(record, lower, names)
    current = ended.pop("current_ampere") or settings.c_rate * float(np.median(capacity))
    loaded = ~at_rest_in_record(record.current_ampere)
    # Cells under load are warmer than the chamber.
    celsius = float(np.mean(record.celsius[loaded])) if loaded.any() else float(record.celsius[0])
    at = {"celsius": celsius, "contact_ohm": contact_of(positions)}
    ends = {"lower_cutoff_volt": lower, "current_ampere": current}
    balance = balance_string(models, initial_soc=start, **ends, **at)
    # The first full cell ends the charge of a string.
    charged = start + ((1.0 - start) * capacity).min() / capacity
    pulses = {"pulse_second": settings.pulse_second}
    limits = {"initial_soc": charged, "cutoffs_volt": (lower, upper)}
    power = power_of_string(models, balance.as_it_is, **limits, **pulses, **at)
    given = {"discharge_ampere": current} | _capability_row(balance, power, names) | ended
    rows = {
        "cells": [row | _cell_limits(balance, k) for k, row in enumerate(tables["cells"])],
        "pack": [tables["pack"] | given],
        "power": power,
        "waterfall": waterfall_rows(capacity, balance),
    }
    return rows | {"series": tables["series"]}, notes


def cutoffs_of(cells):
    """Lower and upper cut-offs of a list of CellFacts, (cells,) each [V].

    Raises
    ------
    Refusal : one is not stated.
    """
    lacking = [c.cell for c in cells if None in (c.lower_cutoff_volt, c.upper_cutoff_volt)]
    if lacking:
        raise Refusal(f"no cut-offs are stated for {', '.join(lacking)}: wanted both in cells.tsv")
    return tuple(
        np.array([getattr(cell, name) for cell in cells], float)
        for name in ("lower_cutoff_volt", "upper_cutoff_volt")
    )


def _measured_discharge(record, lower, names):
    """What a record took out of the string; its current where that is one, ended by a cell."""
    current, time = record.current_ampere, record.test_time_second
    down = discharging(current)
    drawn = -passed_ampere_hour(time, current) * (down[1:] | down[:-1])
    volt = 0.5 * (record.voltage_volt[1:] + record.voltage_volt[:-1])
    row = {
        "record_ampere_hour": float(drawn.sum()),
        "record_watt_hour": float((drawn * volt).sum()),
    }
    cells = logged(record.cell_voltage_volt, (len(time), len(names)))
    unknown = {"current_ampere": None, "measured_ampere_hour": np.nan}
    unknown |= {"measured_watt_hour": np.nan, "measured_ended_by": ""}
    if not down.any() or not np.isfinite(cells).all():
        return row | unknown
    end = int(np.flatnonzero(down)[-1])
    above = cells[end] - lower
    # A cycler's constant current scatters by less than 2 %; what ends 10 mV above a cell's cut-off
    # or lower was ended by it.
    constant = np.std(current[down]) < 0.02 * np.abs(current).max()
    if not constant or above.min() > 0.01:
        return row | unknown
    return row | {
        "current_ampere": float(-current[down].mean()),
        "measured_ampere_hour": row["record_ampere_hour"],
        "measured_watt_hour": row["record_watt_hour"],
        "measured_ended_by": names[int(np.argmin(above))],
    }


def _capability_row(balance, power, names):
    """What the string gives, who ends it with what margin, and what balancing would bring."""
    now, top, bottom = balance.as_it_is, balance.balanced_at_top, balance.balanced_at_bottom
    margins = np.sort(now.end_ampere_hour - now.capacity_ampere_hour)
    half = power[len(power) // 2]  # the point at which half the charge is taken
    brought = top.capacity_ampere_hour - now.capacity_ampere_hour
    more = top.energy_watt_hour - now.energy_watt_hour
    return {
        "usable_ampere_hour": now.capacity_ampere_hour,
        "usable_watt_hour": now.energy_watt_hour,
        "ended_by": names[now.weakest],
        "margin_to_second_ampere_hour": float(margins[1]) if len(margins) > 1 else np.nan,
        "margin_median_ampere_hour": float(np.nanmedian(margins)),
        "soc_spread_at_end": float(np.ptp(now.soc_at_end)),
        "top_balancing_ampere_hour": float(balance.top_ampere_hour.sum()),
        "bottom_balancing_ampere_hour": float(np.nansum(balance.bottom_ampere_hour)),
        "balanced_ampere_hour": top.capacity_ampere_hour,
        "balancing_brings_ampere_hour": brought,
        "balancing_brings_watt_hour": more,
        "balancing_brings_percent": 100.0 * more / now.energy_watt_hour,
        "bottom_balanced_watt_hour": bottom.energy_watt_hour,
        "charge_moved_ampere_hour": balance.level_ampere_hour,
        "discharge_power_half_watt": half["discharge_watt"],
        "charge_power_half_watt": half["charge_watt"],
    }


def _cell_limits(balance, k):
    now = balance.as_it_is
    return {
        "end_ampere_hour": float(now.end_ampere_hour[k]),
        "margin_ampere_hour": float(now.end_ampere_hour[k] - now.capacity_ampere_hour),
        "volt_at_pack_end": float(now.voltage_at_end_volt[k]),
        "soc_at_pack_end": float(now.soc_at_end[k]),
        "top_balancing_ampere_hour": float(balance.top_ampere_hour[k]),
        "bottom_balancing_ampere_hour": float(balance.bottom_ampere_hour[k]),
    }


def waterfall_rows(capacity, balance):
    """From the cells' capacities [Ah] down to what the string gives: stage, Ah, Wh and share."""
    now, top = balance.as_it_is, balance.balanced_at_top
    stages = [
        ("mean capacity of the cells", float(capacity.mean()), np.nan),
        ("mean of the cells at this current", balance.level_ampere_hour, np.nan),
        ("first cell to be empty, balanced", top.capacity_ampere_hour, top.energy_watt_hour),
        ("as it is balanced", now.capacity_ampere_hour, now.energy_watt_hour),
    ]
    return [
        {"stage": stage, "ampere_hour": charge, "watt_hour": energy, "share": charge / stages[0][1]}
        for stage, charge, energy in stages
    ]
