"""Columns of the linear problem of an identification: what each parameter adds to the voltage."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import ocv_on_grid, usual_slope
from cellwright.circuits.circuit import SPHERE_MODES, UNRESOLVED_SECOND
from cellwright.circuits.temperature import table_soc
from cellwright.numerics.lags import lag, lag_by_charge, mean_over_steps
from cellwright.numerics.linear import hats

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

    records : tuple of Record. knots : (k,) SoC, ascending [1]. ocv_volt : (p,) table on an even
    grid of SoC from 0 to 1 [V]. hold : hold of the current between samples. most_volt : (k,)
    largest hysteresis at the knots [V], None where no slow test bounds it. counted_std : standard
    deviation of the capacity and of what the records count, relative; NaN where not known [1].
    kept : dict of columns, filled as they are asked for. They follow from records and knots alone:
    data with another OCV table or bound of the hysteresis share them.
    """

    records: tuple
    knots: np.ndarray
    ocv_volt: np.ndarray
    hold: str
    capacity_ampere_hour: float
    kept: dict
    most_volt: np.ndarray | None = None
    counted_std: float = np.nan


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
    """OCV at a SoC of the table (n,) [V]; what is missing at full may lead beyond its end."""
    return ocv_on_grid(data.ocv_volt, soc_of_table)


MOST_KEPT = 48  # columns of time constants and the like: a drive's take some megabytes each


def used_column(data, name):
    """A column of the used rows of all records, one record after the other (n,); kept.

    Parameters
    ----------
    data : Data. name : of a column of Record.
    """
    return _kept(data, name, lambda: _joined(data, [getattr(r, name) for r in data.records]))


def _shapes(data):
    """Hats of each record over the knots: tuple of (rows, k)."""
    return _kept(data, "shapes", lambda: tuple(hats(r.soc, data.knots) for r in data.records))


def _ohmic_ampere(data):
    """The same times the current, scaled by the resistance factor: tuple of (rows, k) [A]."""

    def make():
        pairs = zip(data.records, _shapes(data), strict=True)
        return tuple(
            shape * (record.current_ampere * record.resistance_factor)[:, None]
            for record, shape in pairs
        )

    return _kept(data, "ohmic_ampere", make)


def _joined(data, values):
    """Used rows of all records, one after the other; columns lie one by one in memory."""
    pairs = zip(data.records, values, strict=True)
    return np.asfortranarray(np.concatenate([value[record.used] for record, value in pairs]))


def columns_of(data, held):
    """All columns of the linear problem for what is held.

    Parameters
    ----------
    data : Data. held : Held.

    Returns
    -------
    columns : Columns; "r0" first, then one entry a time constant, then "m" with hysteresis. With
        kinetics the ohmic "r0" is followed by "rct", the transfer that no sample resolves.
    """
    soc = used_column(data, "soc")
    surface_soc = on_table(soc, held)
    if held.diffusion_second is not None:
        surface_soc = surface_soc + _lead_of_used(data, held.diffusion_second)
    slope = usual_slope(data.ocv_volt, surface_soc)
    return Columns(
        used_column(data, "voltage_volt") - ocv_of(data, surface_soc),
        _kept(data, "hats", lambda: _joined(data, _shapes(data))),
        -np.column_stack([slope, slope * (1.0 - soc)]),
        resistance_columns(data, held),
        slope,
        np.array([held.missing, held.stretch]),
        data.most_volt,
    )


def resistance_columns(data, held):
    """Columns (name, (n, k)) of each resistance and of the hysteresis over the used rows.

    Parameters
    ----------
    data : Data. held : Held.
    """
    ohmic = _ohmic_ampere(data)
    columns = [("r0", _kept(data, "r0", lambda: _joined(data, ohmic)))]
    damped = _damped(data, held)
    if damped is not None:
        columns.append(("rct", _relaxing(data, damped, UNRESOLVED_SECOND)))
    for number, tau in enumerate(held.tau_second, 1):
        if damped is not None and tau <= FAST_SECOND:
            column = _relaxing(data, damped, tau)
        else:
            key = "tau", float(tau)
            column = _kept(data, key, lambda tau=tau: _relaxing(data, ohmic, tau))
        columns.append((f"r{number}", column))
    if held.charge_ampere_hour is not None:
        columns.append(("m", _hysteresis_of_used(data, held.charge_ampere_hour)))
    return columns


def _kept(data, key, make):
    """A column that was made before of these records and knots, else made now.

    Where too many are kept, the oldest of those goes that belong to one time constant or the like.
    """
    of = data.records, data.knots  # held with what is kept, so that their numbers stay theirs
    whole = key, *map(id, of), data.hold, data.capacity_ampere_hour
    if whole not in data.kept:
        if len(data.kept) >= MOST_KEPT:
            del data.kept[next(one for one in data.kept if isinstance(one[0], tuple))]
        data.kept[whole] = of, make()
    return data.kept[whole][1]


def _relaxing(data, drives, tau_second):
    """Lag of each record's drive by one time constant, over the used rows (n, k)."""
    pairs = zip(data.records, drives, strict=True)
    return _joined(
        data,
        [lag(np.diff(r.test_time_second), tau_second, drive, hold=data.hold) for r, drive in pairs],
    )


def _damped(data, held):
    """Drive of the charge transfer in each record (rows, k) [A]; None where it is linear."""
    if held.scale_volt is None:
        return None
    parts = zip(data.records, _shapes(data), _ohmic_ampere(data), strict=True)
    return [ohmic * damping(record, shape, held)[:, None] for record, shape, ohmic in parts]


def _hysteresis_of_used(data, charge_ampere_hour):
    def make():
        pairs = zip(data.records, _shapes(data), strict=True)
        return _joined(data, [_hysteresis(*pair, charge_ampere_hour, data.hold) for pair in pairs])

    return _kept(data, ("charge", float(charge_ampere_hour)), make)


def _lead_of_used(data, diffusion_second):
    def make():
        return _joined(data, [lead(data, record, diffusion_second) for record in data.records])

    return _kept(data, ("lead", float(diffusion_second)), make)


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
