"""Columns of the linear problem of an identification: what each parameter adds to the voltage."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import SPHERE_MODES, UNRESOLVED_SECOND
from cellwright.circuits.temperature import table_soc
from cellwright.numerics.lags import lag, lag_by_charge, mean_over_steps
from cellwright.numerics.linear import hats

SOC_WINDOW = 0.01  # over which the slope of an OCV table is taken
FAST_SECOND = 5.0  # what relaxes faster may be charge transfer, what is slower is diffusion


class Held(NamedTuple):
    """Parameters that are held while the linear ones are solved for.

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
    """Records, OCV table and SoC knots of an identification.

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


def ocv_of(data, soc_of_table):
    """OCV at a SoC of the table (n,), on its first and last slope outside the table [V].

    What is missing at full would else hit the table's flat end.
    """
    table, volt = data.ocv_soc, data.ocv_volt
    low = (volt[1] - volt[0]) / (table[1] - table[0])
    high = (volt[-1] - volt[-2]) / (table[-1] - table[-2])
    beyond = (
        np.minimum(soc_of_table - table[0], 0.0) * low
        + np.maximum(soc_of_table - table[-1], 0.0) * high
    )
    return np.interp(soc_of_table, table, volt) + beyond


def slope_of(data, soc_of_table):
    """Slope of `ocv_of`, as the difference over a window [V]."""
    half = SOC_WINDOW / 2
    return (ocv_of(data, soc_of_table + half) - ocv_of(data, soc_of_table - half)) / SOC_WINDOW


class Base(NamedTuple):
    """What the columns of a set of data have in common, whatever is held.

    shapes : tuple of (rows, k), hats of each record over the knots. ohmic_ampere : tuple of
    (rows, k), the same times the current, scaled by the resistance factor [A].
    soc, voltage_volt : (n,) of the used rows of all records. hats : (n, k) of these. scale_soc :
    (n, 2) change of the table's SoC by what is missing at full, and by the stretch, negative.
    kept : dict of columns that do not change while a model is searched for, filled as they are
    asked for: by the time constant, the charge constant and the diffusion time.
    """

    data: Data
    shapes: tuple
    ohmic_ampere: tuple
    soc: np.ndarray
    voltage_volt: np.ndarray
    hats: np.ndarray
    scale_soc: np.ndarray
    kept: dict


MOST_KEPT = 48  # columns of time constants and the like: a drive's take some megabytes each


def base_of(data):
    """Base of a set of data, with no column kept yet.

    Parameters
    ----------
    data : Data.

    Returns
    -------
    base : Base.
    """
    shapes = tuple(hats(record.soc, data.knots) for record in data.records)
    ampere = [record.current_ampere * record.resistance_factor for record in data.records]
    ohmic = tuple(shape * a[:, None] for shape, a in zip(shapes, ampere, strict=True))
    soc = _joined(data, [record.soc for record in data.records])
    volt = _joined(data, [record.voltage_volt for record in data.records])
    scale = np.column_stack([np.ones(len(soc)), 1.0 - soc])
    return Base(data, shapes, ohmic, soc, volt, _joined(data, shapes), scale, {})


def _joined(data, values):
    """Used rows of all records, one after the other; columns lie one by one in memory."""
    pairs = zip(data.records, values, strict=True)
    return np.asfortranarray(np.concatenate([value[record.used] for record, value in pairs]))


def columns_of(base, held):
    """All columns of the linear problem for what is held.

    Parameters
    ----------
    base : Base, from `base_of`.
    held : Held.

    Returns
    -------
    columns : Columns; "r0" first, then one entry a time constant, then "m" with hysteresis. With
        kinetics the ohmic "r0" is followed by "rct", the transfer that no sample resolves.
    """
    data, surface_soc = base.data, on_table(base.soc, held)
    if held.diffusion_second is not None:
        surface_soc = surface_soc + _kept_lead(base, held.diffusion_second)
    slope = slope_of(data, surface_soc)
    return Columns(
        base.voltage_volt - ocv_of(data, surface_soc),
        base.hats,
        -slope[:, None] * base.scale_soc,
        resistance_columns(base, held),
        slope,
        np.array([held.missing, held.stretch]),
        data.most_volt,
    )


def resistance_columns(base, held):
    """Columns (name, (n, k)) of each resistance and of the hysteresis over the used rows.

    Parameters
    ----------
    base : Base. held : Held.
    """
    columns = [("r0", _kept(base, "r0", lambda: _joined(base.data, base.ohmic_ampere)))]
    damped = _damped(base, held)
    if damped is not None:
        columns.append(("rct", _relaxing(base.data, damped, UNRESOLVED_SECOND)))
    for number, tau in enumerate(held.tau_second, 1):
        if damped is not None and tau <= FAST_SECOND:
            columns.append((f"r{number}", _relaxing(base.data, damped, tau)))
        else:
            columns.append((f"r{number}", _kept_relaxing(base, tau)))
    if held.charge_ampere_hour is not None:
        columns.append(("m", _kept_hysteresis(base, held.charge_ampere_hour)))
    return columns


def _kept(base, key, make):
    """A column that was made before, else made now; where too many are kept the oldest goes."""
    if key not in base.kept:
        if len(base.kept) >= MOST_KEPT:
            del base.kept[next(iter(base.kept))]
        base.kept[key] = make()
    return base.kept[key]


def _kept_relaxing(base, tau_second):
    return _kept(
        base,
        ("tau", float(tau_second)),
        lambda: _relaxing(base.data, base.ohmic_ampere, tau_second),
    )


def _relaxing(data, drives, tau_second):
    """Lag of each record's drive by one time constant, over the used rows (n, k)."""
    pairs = zip(data.records, drives, strict=True)
    return _joined(
        data,
        [lag(np.diff(r.test_time_second), tau_second, drive, hold=data.hold) for r, drive in pairs],
    )


def _damped(base, held):
    """Drive of the charge transfer in each record (rows, k) [A]; None where it is linear."""
    if held.scale_volt is None:
        return None
    parts = zip(base.data.records, base.shapes, base.ohmic_ampere, strict=True)
    return [ohmic * damping(record, shape, held)[:, None] for record, shape, ohmic in parts]


def _kept_hysteresis(base, charge_ampere_hour):
    data = base.data

    def make():
        pairs = zip(data.records, base.shapes, strict=True)
        return _joined(data, [_hysteresis(*pair, charge_ampere_hour, data.hold) for pair in pairs])

    return _kept(base, ("charge", float(charge_ampere_hour)), make)


def _kept_lead(base, diffusion_second):
    data = base.data

    def make():
        return _joined(data, [lead(data, record, diffusion_second) for record in data.records])

    return _kept(base, ("lead", float(diffusion_second)), make)


def lead(data, record, diffusion_second):
    """SoC at the particles' surface less the mean SoC (n,) [1].

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
    """Factor asinh(x)/x, x = r·I/scale, of kinetics relative to their small-current resistance."""
    if held.transfer_ohm is None:
        return np.ones(len(record.soc))
    over = np.abs(shape @ held.transfer_ohm * record.current_ampere * record.resistance_factor)
    x = np.maximum(over / held.scale_volt, 1e-6)
    return np.arcsinh(x) / x


def _hysteresis(record, shape, charge_ampere_hour, hold):
    current = record.current_ampere
    mean = mean_over_steps(current, hold)
    passed = np.abs(mean) * np.diff(record.test_time_second) / 3600.0
    return lag_by_charge(passed, charge_ampere_hour, shape[:-1] * np.sign(mean)[:, None])
