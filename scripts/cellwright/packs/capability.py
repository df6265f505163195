"""What a series pack can give: capacity, energy and power, and which cell limits them."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import simulate_model
from cellwright.packs.series import simulate_string
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
STEP_SHARE = 0.002  # of the charge of the largest cell, a step of a simulated discharge
BEYOND = 1.05  # a discharge is followed this much further than the largest cell holds
LONG_REST_SECOND = 1e7  # between simulated pulses: every relaxation has ended
ROUNDS = 6  # of the secant that finds a pulse's current; it stops at 0.1 mV
SMALL_VOLT = 1e-4


class Discharge(NamedTuple):
    """A constant-current discharge of a string until its first cell is at its lower cut-off.

    capacity_ampere_hour, energy_watt_hour : of the string. weakest : index of the cell that ends
    it. end_ampere_hour : (cells,) charge at which each cell alone would be at its own cut-off, NaN
    where it is not reached. voltage_at_end_volt, soc_at_end : (cells,) when the string has ended.
    charge_ampere_hour, cell_voltage_volt : (n,), (n, cells) the simulated discharge to that end.
    """

    capacity_ampere_hour: float
    energy_watt_hour: float
    weakest: int
    end_ampere_hour: np.ndarray
    voltage_at_end_volt: np.ndarray
    soc_at_end: np.ndarray
    charge_ampere_hour: np.ndarray
    cell_voltage_volt: np.ndarray


def discharge_string(models, *, lower_cutoff_volt, current_ampere, initial_soc, celsius=25.0):
    """Discharge a rested string at a constant current until the first cell is empty.

    The string gives no more than its first cell to reach its cut-off: the shortest stave of the
    barrel. The other cells are followed to their own cut-offs, which says by how much they would
    have lasted longer.

    Parameters
    ----------
    models : model dicts in the order of the string.
    lower_cutoff_volt : scalar or (cells,) [V]. current_ampere : > 0 [A].
    initial_soc : scalar or (cells,) [1]. celsius : of all cells [degC].

    Returns
    -------
    discharge : Discharge.

    Raises
    ------
    Refusal : no cell reaches its cut-off, or as `series.simulate_string`.
    """
    cells = len(models)
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    start = np.broadcast_to(np.asarray(initial_soc, float), (cells,))
    longest = BEYOND * float((start * capacity).max())
    charge = np.linspace(0.0, longest, int(BEYOND / STEP_SHARE) + 1)
    second = 3600.0 * charge / current_ampere
    run = simulate_string(
        models,
        second,
        np.full(len(second), -float(current_ampere)),
        initial_soc=start,
        temperature_celsius=celsius,
        hold="zero_order",
    )
    cutoff = np.broadcast_to(np.asarray(lower_cutoff_volt, float), (cells,))
    pairs = zip(run.cell_voltage_volt.T, cutoff, strict=True)
    ends = np.array([first_crossing(charge, volt, limit) for volt, limit in pairs])
    if not np.isfinite(ends).any():
        lowest = run.cell_voltage_volt[-1].min()
        raise Refusal(
            f"no cell falls to its cut-off of {cutoff.min():g} V in a discharge of "
            f"{longest:.3g} Ah; the lowest ends at {lowest:.3f} V"
        )
    return _ended(ends, charge, run)


def first_crossing(charge, volt, limit):
    """Charge at which a falling voltage meets a limit, linear between samples; NaN where never.

    Parameters
    ----------
    charge, volt : (n,). limit : scalar [V]. A voltage below the limit at the start gives 0.
    """
    below = np.flatnonzero(volt <= limit)
    if not len(below):
        return np.nan
    k = below[0]
    if k == 0:
        return 0.0
    share = (volt[k - 1] - limit) / (volt[k - 1] - volt[k])
    return float(charge[k - 1] + share * (charge[k] - charge[k - 1]))


def _ended(ends, charge, run):
    weakest = int(np.nanargmin(ends))
    end = ends[weakest]
    kept = charge < end
    grid = np.append(charge[kept], end)

    def until_end(columns):
        at_end = [np.interp(end, charge, column) for column in columns.T]
        return np.vstack([columns[kept], at_end])

    voltage, soc = until_end(run.cell_voltage_volt), until_end(run.soc)
    energy = np.trapezoid(voltage.sum(axis=1), grid)
    state = (voltage[-1], soc[-1], grid, voltage)
    return Discharge(float(end), float(energy), weakest, ends, *state)


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


def balance_string(models, *, lower_cutoff_volt, current_ampere, initial_soc, celsius=25.0):
    """Balancing of a string: the charge to take out of each cell, and what that would bring.

    A string is charged until its first cell is full and discharged until its first is empty. With
    cell k lacking C_k to full and holding D_k to empty, that gives min C + min D. Balanced by
    bleeding, at the top or at the bottom, the same cell is first at both ends, and it gives
    min(C + D), the smallest cell; no bleeding gives more. What lies above it needs charge to be
    moved: at best the mean of C + D.

    Parameters
    ----------
    models, lower_cutoff_volt, current_ampere, initial_soc, celsius : as of `discharge_string`;
        SoC is that at any one moment at rest.

    Returns
    -------
    balance : Balance.

    Raises
    ------
    Refusal : as `discharge_string`.
    """
    # ASSUME: A cell is full at SoC 1: the string's charge ends with a held voltage or a small
    # current.
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    soc = np.broadcast_to(np.asarray(initial_soc, float), capacity.shape)
    lacking = (1.0 - soc) * capacity
    settings = {"lower_cutoff_volt": lower_cutoff_volt, "current_ampere": current_ampere}
    settings["celsius"] = celsius

    def from_soc(start):
        return discharge_string(models, initial_soc=start, **settings)

    charged = soc + lacking.min() / capacity
    as_it_is, at_top = from_soc(charged), from_soc(1.0)
    whole = at_top.end_ampere_hour
    surplus = whole - np.nanmin(whole)
    at_bottom = from_soc(1.0 - np.nan_to_num(surplus) / capacity)
    held = as_it_is.end_ampere_hour
    return Balance(
        lacking.max() - lacking,
        held - np.nanmin(held),
        as_it_is,
        at_top,
        at_bottom,
        float(np.mean(whole)),
    )


class Power(NamedTuple):
    """Power of a string over its charge, (points,) each.

    discharged_share : of what the string gives [1]. mean_soc : of its cells.
    discharge_watt, charge_watt : at the end of a pulse that brings the first cell to its limit, and
    the index of that cell, limiting_discharge and limiting_charge; *_ampere: its current.
    """

    discharged_share: np.ndarray
    mean_soc: np.ndarray
    discharge_watt: np.ndarray
    discharge_ampere: np.ndarray
    limiting_discharge: np.ndarray
    charge_watt: np.ndarray
    charge_ampere: np.ndarray
    limiting_charge: np.ndarray


def power_of_string(
    models,
    discharge,
    *,
    initial_soc,
    cutoffs_volt,
    celsius=25.0,
    pulse_second=SETTINGS.pulse_second,
    points=SETTINGS.power_points,
):
    """Power of a string in pulses from rest, limited by its first cell, over its discharge.

    At each point every cell is at rest at its own SoC. The current of a pulse is the one at which
    the first cell is at its lower (upper) cut-off when the pulse ends; the power is that current
    times the voltage of the whole string then.

    Parameters
    ----------
    models : model dicts. discharge : Discharge of the string, from `initial_soc`.
    initial_soc : scalar or (cells,) [1]. cutoffs_volt : lower and upper, scalars or (cells,) [V].
    celsius : [degC]. pulse_second : length of a pulse [s]. points : of the discharge.

    Returns
    -------
    power : Power. Zero where a cell is at or beyond its limit before the pulse.

    Raises
    ------
    Refusal : as `model_file.simulate_model`.

    Source: pulse power by cut-off voltages, FreedomCAR Battery Test Manual (2003), 4.3; here with
    the model's whole response instead of one resistance.
    """
    share = np.linspace(0.0, 1.0, points)
    drawn = share * discharge.capacity_ampere_hour
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    start = np.broadcast_to(np.asarray(initial_soc, float), capacity.shape)
    soc = start - drawn[:, None] / capacity
    pulses = {}
    for sign, cutoff in zip((-1, 1), cutoffs_volt, strict=True):
        limits = np.broadcast_to(np.asarray(cutoff, float), capacity.shape)
        settings = {"sign": sign, "celsius": celsius, "pulse_second": pulse_second}
        found = [
            limiting_current(model, soc[:, k], limits[k], **settings)
            for k, model in enumerate(models)
        ]
        limiting = np.argmin(found, axis=0)
        ampere = np.min(found, axis=0)
        volt = [
            pulse_volt(model, soc[:, k], sign * ampere, celsius=celsius, pulse_second=pulse_second)
            for k, model in enumerate(models)
        ]
        pulses[sign] = (ampere * np.sum(volt, axis=0), ampere, limiting)
    return Power(share, soc.mean(axis=1), *pulses[-1], *pulses[1])


def limiting_current(model, soc, limit_volt, *, sign, celsius, pulse_second):
    """Current of a pulse from rest at whose end a cell is at a limit of its voltage, (p,) [A].

    Parameters
    ----------
    model : model dict. soc : (p,) [1]. limit_volt : [V]. sign : −1 for a discharge, 1 for a charge.

    Returns
    -------
    current_ampere : (p,) its size; 0 where the cell is beyond the limit at rest.
    """
    settings = {"celsius": celsius, "pulse_second": pulse_second}
    rested = pulse_volt(model, soc, np.zeros(len(soc)), **settings)
    room = sign * (limit_volt - rested)
    tried = np.full(len(soc), model["capacity_ampere_hour"])
    for _ in range(ROUNDS):
        change = sign * (pulse_volt(model, soc, sign * tried, **settings) - rested)
        if np.all(np.abs(change - room)[room > 0] < SMALL_VOLT):
            break
        tried = np.where(room > 0, tried * room / np.maximum(change, SMALL_VOLT), tried)
    return np.where(room > 0, tried, 0.0)


def pulse_volt(model, soc, current_ampere, *, celsius, pulse_second):
    """Voltage of a cell at the end of pulses from rest, (p,) [V].

    Parameters
    ----------
    model : model dict. soc : (p,) before each pulse [1]. current_ampere : (p,) [A], positive on
        charge. celsius : [degC]. pulse_second : [s].
    """
    # One record of all pulses, each begun at rest, with rests in which everything relaxes.
    begin = np.arange(len(soc)) * (LONG_REST_SECOND + pulse_second)
    time = np.column_stack([begin, begin + pulse_second, begin + pulse_second]).ravel()
    current = np.column_stack([current_ampere, current_ampere, np.zeros(len(soc))]).ravel()
    moved = current_ampere * pulse_second / 3600.0 / model["capacity_ampere_hour"]
    course = np.column_stack([soc, soc + moved, soc + moved]).ravel()
    celsius = np.full(len(time), float(celsius))
    run = simulate_model(model, None, time, current, course, celsius, hold="zero_order")
    return run.voltage_volt[1::3]
