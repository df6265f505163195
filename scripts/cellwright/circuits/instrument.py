"""What a member knows beside its circuit: of the instrument, of the charge, of its own heat.

Blocks of a member of a model file, each with the names that it needs and no others; what is not
named is zero. A member without blocks is its circuit alone.

`reading` : current_offset_ampere [A], current_gain_relative [1], voltage_offset_volt [V],
    voltage_gain_relative [1], voltage_delay_second [s]: what the instrument reads is off by these.
`counting` : capacity_relative [1], what the cell's capacity is above the model's;
    capacity_test_relative [1], the same in capacity tests; capacity_relative_per_kelvin [1/K], from
    25 °C on; leak_ampere [A]; lost_share_of_charge [1], of what is charged.
`own_heat` : thermal_resistance_kelvin_per_watt [K/W], time_constant_second [s],
    activation_energy_joule_per_mole [J/mol]: the rise of the core over the measured temperature.
`history` : near_end_soc [1]: a cell that a record finds as near full was charged to get there.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import KINDS
from cellwright.circuits.temperature import resistance_factor
from cellwright.numerics.lags import lag, lag_by_charge
from cellwright.records.basis import REFERENCE_CELSIUS
from cellwright.records.thinning import driven

ABOUT = {
    "reading": "what the instrument reads is off",
    "counting": "charge is not what was counted",
    "own_heat": "the cell is warmer inside than was measured",
}
WARMED = ("r_ohm", "r_charge_ohm", "r_discharge_ohm", "soc_per_ampere")
FOLLOWS = ("switch", "hysteresis")  # kinds whose voltage before the first load is history
EDGE_SECOND = 0.06  # before the stamp of a row, within which the current of the row sets in
LOADED_C_RATE = 0.01  # below it a current turns no hysteresis


class Corrected(NamedTuple):
    """A record as it was in truth, by a member: (n,) each.

    current_ampere : through the cell [A]. charging_ampere : what of it, less the leak, moves the
    SoC [A]. soc : state of charge, counted on from the stated start [1].
    """

    current_ampere: np.ndarray
    charging_ampere: np.ndarray
    soc: np.ndarray


def corrected(
    member, capacity_ampere_hour, test_time_second, current_ampere, soc, celsius, *, kind=None
):
    """Current and SoC of a record without the faults of the instrument, with losses of charge.

    Parameters
    ----------
    member : dict of a model file, with or without blocks.
    capacity_ampere_hour : of the model, by which `soc` was counted [Ah].
    test_time_second, current_ampere, soc : (n,) as read and counted [s], [A], [1].
    celsius : scalar or (n,) [degC]. kind : of the test, for "capacity_test_relative".

    Returns
    -------
    corrected : Corrected; the record as it is where the member has no such block.
    """
    if not {"reading", "counting"} & member.keys():
        return Corrected(current_ampere, current_ampere, soc)
    reading, counting = member.get("reading", {}), member.get("counting", {})
    factor, offset = _factor(reading), reading.get("current_offset_ampere", 0.0)
    kept, leak = 1.0 - counting.get("lost_share_of_charge", 0.0), counting.get("leak_ampere", 0.0)
    hours = np.diff(test_time_second, prepend=test_time_second[0]) / 3600.0
    read = np.diff(soc, prepend=soc[0]) * capacity_ampere_hour
    moved = (read - offset * hours) * factor
    moved = np.where(moved > 0, kept, 1.0) * moved - leak * hours
    current = (np.asarray(current_ampere, float) - offset) * factor
    size = capacity_ampere_hour * capacity_factor(member, celsius, kind=kind)
    charging = np.where(current > 0, kept, 1.0) * current - leak
    return Corrected(current, charging, soc[0] + np.cumsum(moved / size))


def capacity_factor(member, celsius=None, *, kind=None):
    """Capacity of a cell by a member, over that of its model [1].

    Parameters
    ----------
    member : dict of a model file.
    celsius : scalar or (n,) [degC]; None or NaN: as at 25 °C. kind : of the test, or None.
    """
    counting, factor = member.get("counting", {}), _factor(member.get("reading", {}))
    name = "capacity_test_relative" if kind == "capacity" else "capacity_relative"
    above = np.asarray(REFERENCE_CELSIUS if celsius is None else celsius) - REFERENCE_CELSIUS
    slope = counting.get("capacity_relative_per_kelvin", 0.0)
    warm = 1.0 + slope * np.nan_to_num(above)
    return factor * (1.0 + counting.get(name, 0.0)) * warm


def hold_of(member, current_ampere):
    """Hold of the current between samples that a member was found with.

    Where the current stepped between steady stretches it did so at once, whatever it does in a
    drive: there it is held until the step.

    Parameters
    ----------
    member : dict of a model file. current_ampere : (n,) of the record [A].
    """
    hold = member.get("hold", "first_order")
    return "zero_order" if "hold" in member and not driven(current_ampere) else hold


def words_of(member, blocks=tuple(ABOUT)):
    """What of a member is not its circuit, one sentence each: exports and filters say so.

    Parameters
    ----------
    member : dict of a model file. blocks : names of those to tell of.
    """
    found = []
    for block in blocks:
        values = ", ".join(f"{name} {value:.4g}" for name, value in member.get(block, {}).items())
        found += [f"{ABOUT[block]} ({values})"] if values else []
    return found


def as_read(member, test_time_second, voltage_volt, at_once_volt, *, hold):
    """Voltage of a simulation as the instrument of the fitted records would have read it.

    Parameters
    ----------
    member : dict of a model file.
    test_time_second, voltage_volt : (n,) [s], [V].
    at_once_volt : (n,) part of it that follows the current without delay [V].
    hold : of the current between samples. With "zero_order" the old current flows until shortly
        before each stamp; there the voltage has a corner.

    Returns
    -------
    voltage_volt : (n,) [V].
    """
    reading = member.get("reading", {})
    delay = reading.get("voltage_delay_second", 0.0)
    if delay:
        times, volts = test_time_second, voltage_volt
        if hold == "zero_order":
            times, volts = _with_corners(times, volts, at_once_volt)
        voltage_volt = np.interp(np.asarray(test_time_second) - delay, times, volts)
    offset, gain = (
        reading.get(name, 0.0) for name in ("voltage_offset_volt", "voltage_gain_relative")
    )
    return (voltage_volt + offset) * (1.0 + gain) if offset or gain else voltage_volt


def true_volt(member, voltage_volt):
    """Voltage of the terminals, from what the instrument read; a delay is left in it [V].

    Parameters
    ----------
    member : dict of a model file. voltage_volt : (n,) as read [V].
    """
    reading = member.get("reading", {})
    gain = 1.0 + reading.get("voltage_gain_relative", 0.0)
    return np.asarray(voltage_volt, float) / gain - reading.get("voltage_offset_volt", 0.0)


def warmed_within(member, circuit, heat_watt, step_second, celsius, *, hold):
    """Circuit of a cell whose core its own heat has warmed.

    Parameters
    ----------
    member : dict of a model file with `own_heat`.
    circuit : tuple of Branch at the measured temperature, parameters (n,).
    heat_watt : (n,) [W]. step_second : (n−1,) [s]. celsius : scalar or (n,) measured [degC].
    hold : of the heat between samples.

    Returns
    -------
    circuit : tuple of Branch.
    """
    own = member["own_heat"]
    rise = lag(step_second, own["time_constant_second"], heat_watt, hold=hold)
    inside = celsius + own["thermal_resistance_kelvin_per_watt"] * rise
    factor = resistance_factor(inside, celsius, own["activation_energy_joule_per_mole"])

    def warmed(parameters):
        return {name: v * factor if name in WARMED else v for name, v in parameters.items()}

    return tuple(b._replace(parameters=warmed(b.parameters)) for b in circuit)


def heating(circuit):
    """Numbers of the branches of a circuit whose losses warm it and that temperature changes.

    Parameters
    ----------
    circuit : tuple of Branch.
    """
    return [k for k, branch in enumerate(circuit) if set(WARMED[:3]) & branch.parameters.keys()]


def at_once(circuit):
    """Numbers of the branches whose voltage follows the current without delay.

    Parameters
    ----------
    circuit : tuple of Branch.
    """
    return [
        k
        for k, branch in enumerate(circuit)
        if branch.kind not in FOLLOWS and not KINDS[branch.kind].lags(**branch.parameters)
    ]


def led(member, circuit, test_time_second, current_ampere, soc, capacity_ampere_hour, *, hold):
    """What a hysteresis adds that was led to one side before the record: (branches, n) [V].

    Parameters
    ----------
    member : dict of a model file with `history`. circuit : tuple of Branch.
    test_time_second, current_ampere, soc : (n,) of the record [s], [A], [1].
    capacity_ampere_hour : [Ah]. hold : of the current between samples.
    """
    # ASSUME: A cell that a record finds full was charged to get there, an empty one discharged.
    near, current = member["history"]["near_end_soc"], np.asarray(current_ampere, float)
    loaded = np.abs(current) > LOADED_C_RATE * capacity_ampere_hour
    side = np.sign(current[0]) if loaded[0] else (soc[0] > 1 - near) - float(soc[0] < near)
    between = current[:-1] if hold == "zero_order" else (current[:-1] + current[1:]) / 2
    passed = np.abs(between) * np.diff(test_time_second) / 3600.0
    found = np.zeros((len(circuit), len(current)))
    for k, branch in enumerate(circuit):
        p = branch.parameters
        if branch.kind == "hysteresis":
            charge = np.broadcast_to(p["charge_ampere_hour"], current.shape)[:-1]
            gone = lag_by_charge(passed, charge, np.ones(len(passed)))
            found[k] = side * p["m_volt"] * (1.0 - gone)
        if branch.kind == "switch":
            found[k] = side * p["m_volt"] * (np.cumsum(loaded) == 0)
    return found


def _factor(reading):
    """True current over that read, less its offset: so it is with a capacity counted by it."""
    return 1.0 / (1.0 + reading.get("current_gain_relative", 0.0))


def _with_corners(time, volt, at_once_volt):
    old = np.concatenate([at_once_volt[:1], at_once_volt[:-1]])
    step = np.diff(time, prepend=time[0])
    corner = time - np.minimum(EDGE_SECOND, step / 2.0)
    times = np.stack([corner, time], axis=1).ravel()
    return times, np.stack([volt - at_once_volt + old, volt], axis=1).ravel()
