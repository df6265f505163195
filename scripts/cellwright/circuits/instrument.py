"""Blocks of a member beside its circuit: instrument, counting of charge, own heat, history.

Blocks of a member of a model file, each with the names that it needs and no others; what is not
named is zero. A member without blocks is its circuit alone.

`reading` : current_offset_ampere [A], current_gain_relative [1], voltage_offset_volt [V],
    voltage_gain_relative [1], voltage_delay_second [s]: what the instrument reads is off by these.
`counting` : capacity_relative [1], what the cell's capacity is above the model's;
    capacity_test_relative [1], the same in capacity tests; capacity_relative_per_kelvin [1/K], from
    25 °C on; leak_ampere [A], at half charge; log_leak_to_full [1], see `leak_at`;
    lost_share_of_charge [1], of what is charged.
`own_heat` : thermal_resistance_kelvin_per_watt [K/W], time_constant_second [s],
    activation_energy_joule_per_mole [J/mol]: the rise of the core over the measured temperature;
    branches_apart, numbers of the branches (the ohmic resistance is 0) that neither make this heat
    nor change by it.
`history` : near_end_soc [1]: a cell that a record finds as near full was charged to get there.
"""

import numpy as np

from cellwright.circuits.cell import closing
from cellwright.circuits.circuit import KINDS
from cellwright.circuits.messages import say
from cellwright.circuits.temperature import resistance_factor
from cellwright.numerics.lags import lag, lag_by_charge, mean_over_steps
from cellwright.records.conditions import AT_REST_C_RATE, REFERENCE_CELSIUS
from cellwright.records.thinning import driven

BLOCKS = ("reading", "counting", "own_heat")  # that exports and filters tell of
WARMED = ("r_ohm", "r_charge_ohm", "r_discharge_ohm", "soc_per_ampere")
EDGE_SECOND = 0.06  # before the stamp of a row, within which the current of the row sets in
# ASSUME: However cold, a cell keeps a tenth of its capacity; a straight line would end at none.
LEAST_CAPACITY = 0.1


def corrected(
    member, capacity_ampere_hour, test_time_second, current_ampere, soc, celsius, *, kind=None
):
    """Currents and SoC of a record, corrected for instrument errors and losses of charge.

    Parameters
    ----------
    member : dict of a model file, with or without blocks.
    capacity_ampere_hour : of the model, by which `soc` was counted [Ah].
    test_time_second, current_ampere, soc : (n,) as read and counted [s], [A], [1].
    celsius : scalar or (n,) [degC]. kind : of the test, for "capacity_test_relative".

    Returns
    -------
    current_ampere : (n,) through the cell [A]. charging_ampere : (n,) what of it, less the leak,
        moves the SoC [A]. soc : (n,) counted on from the stated start [1]. All as they are where
        the member has no such block.
    """
    if not {"reading", "counting"} & member.keys():
        return current_ampere, current_ampere, soc
    reading, counting = member.get("reading", {}), member.get("counting", {})
    offset, gain = (reading.get(f"current_{n}", 0.0) for n in ("offset_ampere", "gain_relative"))
    lost = counting.get("lost_share_of_charge", 0.0)
    leak = leak_at(soc, counting.get("leak_ampere", 0.0), counting.get("log_leak_to_full", 0.0))
    hours = np.diff(test_time_second, prepend=test_time_second[0]) / 3600.0
    read = np.diff(soc, prepend=soc[0]) * capacity_ampere_hour
    charge = through_cell(read, offset=offset * hours, gain_relative=gain)
    charge = stored(charge, lost_share=lost, leak=leak * hours)
    current = through_cell(np.asarray(current_ampere, float), offset=offset, gain_relative=gain)
    size = capacity_ampere_hour * capacity_factor(member, celsius, kind=kind)
    charging = stored(current, lost_share=lost, leak=leak)
    return current, charging, soc[0] + np.cumsum(charge / size)


def through_cell(read, *, offset=0.0, gain_relative=0.0):
    """Current or charge through the cell from the ammeter's reading: (read − offset)/(1 + gain).

    A capacity that was counted by the same ammeter is one of these charges.

    Parameters
    ----------
    read : scalar or (n,) current [A] or charge [Ah]. offset : of the reading, in its unit.
    gain_relative : [1].
    """
    return (read - offset) * (1.0 / (1.0 + gain_relative))


def stored(moved, *, lost_share=0.0, leak=0.0):
    """Current or charge that changes the SoC, after side reactions and leak.

    Parameters
    ----------
    moved : (n,) positive on charge, current [A] or charge [Ah]. lost_share : of what is charged, by
    side reactions [1]. leak : self-discharge, in the unit of `moved`.
    """
    return np.where(moved > 0, 1.0 - lost_share, 1.0) * moved - leak


def leak_at(soc, leak_ampere, log_to_full):
    """Self-discharge at a SoC, whose logarithm runs straight over the SoC (n,) [A].

    Parameters
    ----------
    soc : (n,) [1]. leak_ampere : at half charge [A]. log_to_full : logarithm of the leak of a full
    cell over that of an empty one [1].
    """
    return leak_ampere * np.exp(log_to_full * (np.clip(soc, 0.0, 1.0) - 0.5))


def capacity_over_temperature(celsius, relative_per_kelvin):
    """Capacity at a temperature over that at 25 °C [1], at least `LEAST_CAPACITY`.

    Parameters
    ----------
    celsius : scalar or (n,) [degC]. relative_per_kelvin : [1/K].
    """
    factor = 1.0 + relative_per_kelvin * (celsius - REFERENCE_CELSIUS)
    return np.maximum(factor, LEAST_CAPACITY)


def capacity_factor(member, celsius=None, *, kind=None):
    """Capacity of a cell by a member, over that of its model [1].

    Parameters
    ----------
    member : dict of a model file.
    celsius : scalar or (n,) [degC]; None or NaN: as at 25 °C. kind : of the test, or None.
    """
    counting, reading = member.get("counting", {}), member.get("reading", {})
    name = "capacity_test_relative" if kind == "capacity" else "capacity_relative"
    counted = through_cell(1.0, gain_relative=reading.get("current_gain_relative", 0.0))
    temperature = np.asarray(REFERENCE_CELSIUS if celsius is None else celsius, float)
    temperature = np.where(np.isnan(temperature), REFERENCE_CELSIUS, temperature)
    slope = counting.get("capacity_relative_per_kelvin", 0.0)
    warm_factor = capacity_over_temperature(temperature, slope)
    return counted * (1.0 + counting.get(name, 0.0)) * warm_factor


def hold_of(member, current_ampere):
    """Hold of the current between samples for a member: "zero_order" or "first_order".

    Where the current stepped between steady stretches it did so at once, whatever it does in a
    drive: there it is held until the step.

    Parameters
    ----------
    member : dict of a model file. current_ampere : (n,) of the record [A].
    """
    hold = member.get("hold", "first_order")
    return "zero_order" if "hold" in member and not driven(current_ampere) else hold


def words_of(member, blocks=BLOCKS):
    """Sentences on the blocks of a member beside its circuit, for exports and filters.

    Parameters
    ----------
    member : dict of a model file. blocks : names of those to tell of.
    """
    sentences = []
    for block in blocks:
        numbers = {n: v for n, v in member.get(block, {}).items() if not isinstance(v, list)}
        values = [
            say(f"number.{n}", value=v, percent=100 * v, milli=1e3 * v, kilo=v / 1e3)
            for n, v in numbers.items()
        ]
        sentences += [say(f"block.{block}", listed=", ".join(values))] if values else []
    return sentences


def as_read(member, test_time_second, voltage_volt, at_once_volt, *, hold):
    """Simulated voltage [V] with the delay, gain and offset of the voltmeter.

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
    if reading.get("voltage_delay_second", 0.0):
        time = np.asarray(test_time_second, float)
        voltage_volt = delayed(
            *(time, voltage_volt, at_once_volt),
            delay_second=reading["voltage_delay_second"],
            step_second=np.diff(time, prepend=time[0]),
            stepped=np.full(len(time), hold == "zero_order"),
        )
    offset, gain = (reading.get(f"voltage_{n}", 0.0) for n in ("offset_volt", "gain_relative"))
    if not (offset or gain):
        return voltage_volt
    return displayed(voltage_volt, offset_volt=offset, gain_relative=gain)


def displayed(volt, *, offset_volt=0.0, gain_relative=0.0):
    """Voltage that the voltmeter shows: (V + offset)·(1 + gain) [V].

    Parameters
    ----------
    volt : (n,) [V]. offset_volt : [V]. gain_relative : [1].
    """
    return (volt + offset_volt) * (1.0 + gain_relative)


def delayed(clock_second, volt, at_once_volt, *, delay_second, step_second, stepped):
    """Voltage at time t − delay [V], interpolated between the rows of the simulation.

    Where the current stepped, the old one flowed until `EDGE_SECOND` before the stamp; there the
    course has a corner, without which a delay shorter than the sampling interval would smear
    every step.

    Parameters
    ----------
    clock_second : (n,) never falling; records that are laid one after the other lie far apart [s].
    volt : (n,) [V]. at_once_volt : (n,) part of it that follows the current without delay [V].
    delay_second : of the voltage behind the current [s].
    step_second : (n,) since the row before, 0 in first rows [s].
    stepped : (n,) bool, the current held its value since the row before and stepped at the stamp.

    Returns
    -------
    volt : (n,) [V].
    """
    edge = np.minimum(EDGE_SECOND, step_second / 2.0)
    begins = step_second <= 0
    old_at_once, old = (
        np.where(begins, column, np.concatenate([column[:1], column[:-1]]))
        for column in (at_once_volt, volt)
    )
    part = np.divide(edge, step_second, out=np.zeros(len(edge)), where=edge > 0)
    straight = volt + part * (old - volt)
    corner = np.where(stepped, volt - at_once_volt + old_at_once, straight)
    times = np.stack([clock_second - edge, clock_second], axis=1).ravel()
    volts = np.stack([corner, volt], axis=1).ravel()
    return np.interp(clock_second - delay_second, times, volts)


def true_volt(member, voltage_volt):
    """Terminal voltage from the voltmeter's reading [V]; its delay is not removed.

    Parameters
    ----------
    member : dict of a model file. voltage_volt : (n,) as read [V].
    """
    reading = member.get("reading", {})
    gain = 1.0 + reading.get("voltage_gain_relative", 0.0)
    return np.asarray(voltage_volt, float) / gain - reading.get("voltage_offset_volt", 0.0)


def warmed_within(member, circuit, heat_watt, step_second, celsius, *, hold):
    """Circuit with its resistances at the core temperature that the cell's own heat gives.

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
    heating_of = member["own_heat"]
    rise = lag(step_second, heating_of["time_constant_second"], heat_watt, hold=hold)
    core_celsius = celsius + heating_of["thermal_resistance_kelvin_per_watt"] * rise
    factor = resistance_factor(
        core_celsius, celsius, heating_of["activation_energy_joule_per_mole"]
    )

    def warmed(parameters):
        return {name: v * factor if name in WARMED else v for name, v in parameters.items()}

    excluded = heating_of.get("branches_apart", [])
    return tuple(
        branch if k in excluded else branch._replace(parameters=warmed(branch.parameters))
        for k, branch in enumerate(circuit)
    )


def heating(member, circuit):
    """Numbers of the ohmic branches that heat the cell and change with that heat.

    Parameters
    ----------
    member : dict of a model file with `own_heat`. circuit : tuple of Branch.
    """
    excluded = member["own_heat"].get("branches_apart", [])
    ohmic = [k for k, branch in enumerate(circuit) if set(WARMED[:3]) & branch.parameters.keys()]
    return [k for k in ohmic if k not in excluded]


def at_once(circuit):
    """Numbers of the branches whose voltage follows the current without delay.

    Parameters
    ----------
    circuit : tuple of Branch.
    """
    return [
        k
        for k, branch in enumerate(circuit)
        if not KINDS[branch.kind].follows_charge
        and not KINDS[branch.kind].lags(**branch.parameters)
    ]


def load_direction(current_ampere, *, least_ampere, soc_at_start, near_end_soc):
    """Sign of the last load at each sample (n,): 1 charge, −1 discharge, 0 none yet.

    Parameters
    ----------
    current_ampere : (n,) as read [A]. least_ampere : below it a current turns no hysteresis [A].
    soc_at_start : [1]; where it is near full or empty, the charge that led there counts as the
    load before the first one, else there is none (0). near_end_soc : how near that is [1].
    """
    # ASSUME: A cell that a record finds full was charged to get there, an empty one discharged.
    current = np.asarray(current_ampere, float)
    sign = np.where(np.abs(current) > least_ampere, np.sign(current), 0.0)
    if sign[0] == 0:
        sign[0] = (soc_at_start > 1 - near_end_soc) - float(soc_at_start < near_end_soc)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return sign[last]


def with_history(
    member, circuit, over_volt, record, read_ampere, *, soc_at_start, capacity_ampere_hour, hold
):
    """Voltage over each branch [V], hysteresis started from the load before the record.

    Parameters
    ----------
    member : dict of a model file with `history`. circuit : tuple of Branch.
    over_volt : (branches, n) of a record that begins with no hysteresis [V].
    record : (test_time_second, current_ampere), (n,) each, current through the cell [s], [A].
    read_ampere : (n,) current as the instrument read it [A]. soc_at_start : [1].
    capacity_ampere_hour : [Ah]. hold : of the current between samples.
    """
    time, current = record
    least = AT_REST_C_RATE * capacity_ampere_hour
    ends = {"soc_at_start": soc_at_start, "near_end_soc": member["history"]["near_end_soc"]}
    direction = load_direction(read_ampere, least_ampere=least, **ends)
    steps = np.diff(time)
    passed = np.abs(mean_over_steps(current, hold)) * steps / 3600.0
    over_volt = np.array(over_volt)
    for k, branch in enumerate(circuit):
        p, kind = branch.parameters, KINDS[branch.kind]
        if not kind.follows_charge:
            continue
        if kind.closes:
            over_volt[k] = closing(branch, steps, current, hold, start=direction[0])
        elif "charge_ampere_hour" in p:
            charge = np.broadcast_to(p["charge_ampere_hour"], current.shape)[:-1]
            decayed = lag_by_charge(passed, charge, np.ones(len(passed)))
            over_volt[k] += direction[0] * p["m_volt"] * (1.0 - decayed)
        else:
            over_volt[k] = direction * p["m_volt"]
    return over_volt
