"""The columns of an identification that is linear once a few numbers are held.

For given time constants, charge constant of the hysteresis and scale of the kinetics, the voltage
is V = U(z') + Σ over knots of (shift, R0, R_j, M) × column, where z' is the counted SoC stretched
by a factor. Each quantity is a course over the same SoC knots, straight between them.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import SPHERE_MODES, UNRESOLVED_SECOND
from cellwright.circuits.temperature import table_soc
from cellwright.numerics.lags import lag, lag_by_charge
from cellwright.numerics.linear import hats

SOC_WINDOW = 0.01  # over which the slope of an OCV table is taken
FAST_SECOND = 5.0  # what relaxes faster may be charge transfer, what is slower is diffusion


class Held(NamedTuple):
    """What is held while the rest is solved for.

    tau_second : (m,) time constants of the RC pairs [s].
    charge_ampere_hour : charge constant of the hysteresis [Ah], None without.
    scale_volt : scale of the kinetics [V], None for linear resistance.
    transfer_ohm : (k,) charge-transfer resistance at the knots that the scale acts on [ohm], None
        at first: linear.
    missing, stretch : the OCV table is read at 1 − missing − (1 − SoC)·(1 + stretch): what a full
        charge left out (in the cold it ends early), and by how much the capacity is smaller [1].
    """

    tau_second: tuple
    charge_ampere_hour: float | None = None
    scale_volt: float | None = None
    transfer_ohm: np.ndarray | None = None
    missing: float = 0.0
    stretch: float = 0.0
    diffusion_second: float | None = None


class Data(NamedTuple):
    """Records and what they are compared with.

    records : tuple of Record. knots : (k,) SoC, ascending [1]. ocv_soc, ocv_volt : (p,) table.
    hold : hold of the current between samples. most_volt : (k,) largest hysteresis at the knots
    [V], None where no slow test bounds it.
    """

    records: tuple
    knots: np.ndarray
    ocv_soc: np.ndarray
    ocv_volt: np.ndarray
    hold: str
    capacity_ampere_hour: float
    most_volt: np.ndarray | None = None


class Columns(NamedTuple):
    """A linear problem over the used rows.

    target_volt : (n,) V − U(z'). shift : (n, k). scale : (n, 2) change of U by what is missing at
    full, and by the stretch [V].
    resistances : list of (name, (n, k)), each not negative. slope_volt : (n,) of U over SoC [V].
    held_scale : (2,) the SoC's scale about which all this holds [1]. most_volt : as in Data.
    """

    target_volt: np.ndarray
    shift: np.ndarray
    scale: np.ndarray
    resistances: list
    slope_volt: np.ndarray
    held_scale: np.ndarray
    most_volt: np.ndarray | None = None


def on_table(soc, held):
    """SoC of the OCV table that belongs to a counted SoC."""
    return table_soc(soc, held.missing, held.stretch)


def ocv_of(data, at):
    """OCV at a SoC of the table (n,), on its first and last slope outside the table [V].

    What is missing at full would else hit the table's flat end.
    """
    table, volt = data.ocv_soc, data.ocv_volt
    low = (volt[1] - volt[0]) / (table[1] - table[0])
    high = (volt[-1] - volt[-2]) / (table[-1] - table[-2])
    beyond = np.minimum(at - table[0], 0.0) * low + np.maximum(at - table[-1], 0.0) * high
    return np.interp(at, table, volt) + beyond


def slope_of(data, at):
    """Slope of `ocv_of`, as the difference over a window [V]."""
    half = SOC_WINDOW / 2
    return (ocv_of(data, at + half) - ocv_of(data, at - half)) / SOC_WINDOW


def columns_of(data, held):
    """All columns of the linear problem for what is held.

    Parameters
    ----------
    data : Data.
    held : Held.

    Returns
    -------
    columns : Columns; "r0" first, then one entry a time constant, then "m" with hysteresis. With
        kinetics the ohmic "r0" is followed by "rct", the transfer that no sample resolves.
    """
    parts = [_of_record(data, record, held) for record in data.records]
    used = [record.used for record in data.records]

    def joined(values):
        return np.concatenate([value[u] for value, u in zip(values, used, strict=True)])

    names = [name for name, _ in parts[0]]
    stacked = [joined([part[i][1] for part in parts]) for i in range(len(names))]
    soc = joined([record.soc for record in data.records])
    volt = joined([record.voltage_volt for record in data.records])
    at = on_table(soc, held)
    if held.diffusion_second is not None:
        at = at + joined([lead(data, record, held.diffusion_second) for record in data.records])
    slope = slope_of(data, at)
    return Columns(
        volt - ocv_of(data, at),
        hats(soc, data.knots),
        -slope[:, None] * np.column_stack([np.ones(len(soc)), 1.0 - soc]),
        list(zip(names, stacked, strict=True)),
        slope,
        np.array([held.missing, held.stretch]),
        data.most_volt,
    )


def _of_record(data, record, held):
    """(name, (n, k)) of each resistance and of the hysteresis, over all rows of a record."""
    shape = hats(record.soc, data.knots)
    ohmic = shape * (record.current_ampere * record.resistance_factor)[:, None]
    damped = ohmic if held.scale_volt is None else ohmic * damping(record, shape, held)[:, None]
    found = [("r0", ohmic)]
    step = np.diff(record.test_time_second)
    if held.scale_volt is not None:
        found.append(("rct", lag(step, UNRESOLVED_SECOND, damped, hold=data.hold)))
    for number, tau in enumerate(held.tau_second, 1):
        drive = damped if tau <= FAST_SECOND else ohmic
        found.append((f"r{number}", lag(step, tau, drive, hold=data.hold)))
    if held.charge_ampere_hour is not None:
        found.append(("m", _hysteresis(record, shape, held.charge_ampere_hour, data.hold)))
    return found


def lead(data, record, diffusion_second):
    """By how much the SoC at the particles' surface leads the mean, (n,) [1].

    In the steady state tau/15 times the rate of change of the SoC (a sphere under constant flux).
    """
    step = np.diff(record.test_time_second)
    gain = diffusion_second / 15.0 / 3600.0 / data.capacity_ampere_hour
    drive = gain * record.current_ampere * record.resistance_factor
    return sum(
        share * lag(step, diffusion_second * constant, drive, hold=data.hold)
        for constant, share in SPHERE_MODES
    )


def damping(record, shape, held):
    """asinh(x)/x with x = r·I/scale: by how much kinetics fall short of their small-current law."""
    if held.transfer_ohm is None:
        return np.ones(len(record.soc))
    over = np.abs(shape @ held.transfer_ohm * record.current_ampere * record.resistance_factor)
    x = np.maximum(over / held.scale_volt, 1e-6)
    return np.arcsinh(x) / x


def _hysteresis(record, shape, charge_ampere_hour, hold):
    current = record.current_ampere
    mean = current[:-1] if hold == "zero_order" else (current[:-1] + current[1:]) / 2
    passed = np.abs(mean) * np.diff(record.test_time_second) / 3600.0
    return lag_by_charge(passed, charge_ampere_hour, shape[:-1] * np.sign(mean)[:, None])
