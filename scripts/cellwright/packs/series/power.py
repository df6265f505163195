"""Power of a series pack in pulses over its discharge, limited by its first cell."""

import numpy as np

from cellwright.circuits.model_file import simulate_model
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
LARGEST_C_RATE = 3.0  # of a pulse: models are not asked what no test has shown
SMALL_VOLT = 1e-4  # a pulse that ends so near to its limit is at it


def power_of_string(
    models,
    discharge,
    *,
    initial_soc,
    cutoffs_volt,
    celsius=25.0,
    contact_ohm=0.0,
    pulse_second=SETTINGS.pulse_second,
    largest_c_rate=LARGEST_C_RATE,
    points=21,  # of 5 % of the charge each
):
    """Power of a string in pulses from rest, limited by its first cell, over its discharge.

    At each point every cell is at rest at its own SoC. The current of a pulse is the one at which
    the first cell is at its lower (upper) cut-off when the pulse ends, or the largest allowed one;
    the power is that current times the voltage of the whole string then.

    Parameters
    ----------
    models : model dicts. discharge : Discharge of the string, from `initial_soc`.
    initial_soc : scalar or (cells,) [1]. cutoffs_volt : lower and upper, scalars or (cells,) [V].
    celsius : [degC]. contact_ohm : of all contacts together [ohm]. pulse_second : length of a pulse
    [s]. largest_c_rate : over the median capacity; beyond it a model has seen no pulse [1/h].
    points : of the discharge.

    Returns
    -------
    rows : list of dict, one a point: discharged_share of what the string gives [1], mean_soc of its
        cells; of a pulse to discharge and one to charge its _watt and _ampere at the end, 0 where a
        cell is at or beyond its limit before it, and the name of the cell that is limiting, ""
        where the largest allowed current is less.

    Source: pulse power by cut-off voltages, FreedomCAR Battery Test Manual (2003), 4.3; here with
    the model's whole response instead of one resistance.
    """
    share = np.linspace(0.0, 1.0, points)
    drawn = share * discharge.capacity_ampere_hour
    capacity = np.array([model["capacity_ampere_hour"] for model in models])
    start = np.broadcast_to(np.asarray(initial_soc, float), capacity.shape)
    soc = start - drawn[:, None] / capacity
    names = np.array([*(model["cell"] for model in models), ""], object)  # the last of no cell
    columns = {"discharged_share": share, "mean_soc": soc.mean(axis=1)}
    at = {"celsius": celsius, "pulse_second": pulse_second}
    for way, sign, cutoff in zip(("discharge", "charge"), (-1, 1), cutoffs_volt, strict=True):
        limits = np.broadcast_to(np.asarray(cutoff, float), capacity.shape)
        cells = list(zip(models, soc.T, limits, strict=True))
        found = [limiting_current(*cell, sign=sign, **at) for cell in cells]
        # Beyond it no pulse was measured: the model would be extrapolated.
        largest = largest_c_rate * np.median(capacity)
        ampere = np.minimum(np.min(found, axis=0), largest)
        limiting = np.where(ampere < largest, np.argmin(found, axis=0), -1)
        volt = [pulse_volt(model, course, sign * ampere, **at) for model, course, _ in cells]
        at_terminals = np.sum(volt, axis=0) + sign * contact_ohm * ampere
        columns[f"{way}_watt"] = ampere * at_terminals
        columns[f"{way}_ampere"], columns[f"limiting_{way}"] = ampere, names[limiting]
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def limiting_current(model, soc, limit_volt, *, sign, celsius, pulse_second):
    """Current of a pulse from rest at whose end a cell is at a limit of its voltage, (p,) [A].

    Parameters
    ----------
    model : model dict. soc : (p,) [1]. limit_volt : [V]. sign : −1 for a discharge, 1 for a charge.
    celsius : [degC]. pulse_second : [s].

    Returns
    -------
    current_ampere : (p,) its size; 0 where the cell is beyond the limit at rest.
    """
    settings = {"celsius": celsius, "pulse_second": pulse_second}
    rested = pulse_volt(model, soc, np.zeros(len(soc)), **settings)
    room = sign * (limit_volt - rested)
    tried = np.full(len(soc), model["capacity_ampere_hour"])
    for _ in range(6):  # a secant: kinetics bend the voltage little within a pulse
        # What the voltage moves by at the current that was tried.
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
    # One record of all pulses, each begun at rest: within 1e7 s every relaxation has ended.
    begin = np.arange(len(soc)) * (1e7 + pulse_second)
    time = np.column_stack([begin, begin + pulse_second, begin + pulse_second]).ravel()
    current = np.column_stack([current_ampere, current_ampere, np.zeros(len(soc))]).ravel()
    moved = current_ampere * pulse_second / 3600.0 / model["capacity_ampere_hour"]
    course = np.column_stack([soc, soc + moved, soc + moved]).ravel()
    celsius = np.full(len(time), float(celsius))
    run = simulate_model(model, None, time, current, course, celsius, hold="zero_order")
    return run.voltage_volt[1::3]
