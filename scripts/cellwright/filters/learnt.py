"""Noise of a filter as the records that its model was fitted to show it.

What a model errs by is no white noise: it lasts seconds and minutes, and stands over SoC. How long
each part lasts, and how large what comes anew at every sample is, the misfit of the records fitted
tells: the noise is that under which its innovations are likeliest. How large the lasting parts are
is told by what was left out of the fit (`bank.Bank`), for a fit has taken what it could. How far a
capacity can be read is told by the same records, whose capacity is known.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.instrument import corrected, hold_of, true_volt
from cellwright.circuits.model_file import member_of, simulate_model
from cellwright.filters.bank import UNSEEN, bank_of, loaded_mean, resistance_factor_of
from cellwright.filters.estimate import Start, estimate_on
from cellwright.filters.kalman import State, run
from cellwright.filters.plant import (
    ERROR,
    Noise,
    Plant,
    edges_of,
    levels_of_plant,
    load_error_volt,
    piece_of,
    plant_of,
)
from cellwright.numerics.statistics import rms
from cellwright.records.conditions import stated_or_reference

MOST, WINDOW = 4000, 400  # rows of a condition that are looked at, in stretches of so many
# Lowest and highest value of each, and where the search begins: the defaults of `Noise`.
LEARNT = {
    "sensor_volt": (2e-5, 0.05),
    "resistance_error": (1e-3, 1.0),
    "fast_second": (2.0, 50.0),
    "skew_second": (1e-3, 1.0),
}
DOUBT = np.log(10.0)  # of the logarithm of each before any record: what none tells stays as it is
TOLERANCE = 1e-4  # of the logarithms of the values, and of that of the likelihood
SURE = 1e-12  # variance of the SoC, which is counted
# ASSUME: Beside a capacity that is a state, an error of the overpotentials that goes with the
# charge of the last minutes would be taken for it: they are then as wrong as of a model that tells
# nothing.
DOUBTED = {"steady_error": Noise().resistance_error}
# Variance of a row that was not fitted [V²]: of a record of role `split` the others score.
UNREAD = 100.0
LEAST_VOLT = 1e-3  # no model is better than a good cycler tells


class Misfit(NamedTuple):
    """What a model leaves of a stretch of a record, as a plant whose only states are its errors.

    plant : Plant. edge_variance : function skew [s] → (n,) [V²]. soc : of its first row [1].
    at_once_volt, load_volt : level of what acts at once, and the stated error under load [V].
    """

    plant: Plant
    edge_variance: object
    soc: float
    at_once_volt: float
    load_volt: float


def with_learnt_noise(model, conditions):
    """The model, its chosen member with the noise that filters take, at each temperature.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, whose chosen member tells how well it fits.
    conditions : list of lists of Record, those that each of its conditions was fitted to, on its
        SoC scale.

    Returns
    -------
    model : the same with `noise` in each condition of that member: the names of `LEARNT`, and
        capacity_misread, by how much filters misread the known capacity there [1]; nothing where no
        record loads the cell.
    """
    entry = member_of(model)
    name = entry["model"]
    celsius = [c["ambient_temperature_celsius"] for c in model["members"][0]["conditions"]]
    at_celsius = dict(zip(celsius, conditions, strict=True))
    # A member that a search found has further temperatures, between those that were fitted.
    told = []
    for condition in entry["conditions"]:
        records = at_celsius.get(condition["ambient_temperature_celsius"], [])
        noise = learnt(model, name, records) if records else None
        told.append(condition | ({"noise": noise} if noise else {}))
    members = [
        member | {"conditions": told} if member["model"] == name else member
        for member in model["members"]
    ]
    return model | {"members": members}


def learnt(model, name, records):
    """Noise of a member at the temperature of some records; see `with_learnt_noise`.

    Parameters
    ----------
    model, name : as in `bank_of`. records : list of Record.

    Returns
    -------
    noise : dict, None where nothing flows in the records.
    """
    stretches, levels = [], []
    for record in records:
        found, level = _stretches(model, name, record, MOST // len(records))
        stretches += found
        levels.append(level)
    if not stretches or max(levels) <= 0.0:
        return None
    digit = max(record.least_digit_volt for record in records) / np.sqrt(12.0)
    low, high = np.log(np.transpose(list(LEARNT.values())))
    low[0] = max(low[0], np.log(max(digit, 1e-12)))
    values = _searched(stretches, low, high)
    noise = dict(zip(LEARNT, np.exp(values).tolist(), strict=True))
    return noise | {"capacity_misread": _misread(model, name, records, Noise(**noise | DOUBTED))}


def _misread(model, name, records, noise):
    """How far off `dual` reads the capacity of records [1]; each counts by what it tells."""
    off, std = [], []
    for record in records:
        bank, ready, hold = as_filtered(model, name, record)
        plant = plant_of(
            bank,
            *(ready.test_time_second, ready.current_ampere, ready.voltage_volt),
            noise,
            hold=hold,
            resistance_factor=ready.resistance_factor,
            track_capacity=True,
            track_ohmic=True,
        )
        plant = plant._replace(edge_variance=np.where(_fitted(record), plant.edge_variance, UNREAD))
        start = Start(float(np.clip(ready.soc[0], 0.0, 1.0)))
        found = estimate_on(plant, start, method="dual", noise=noise)
        off.append(found.capacity_ampere_hour[-1] / plant.capacity_ampere_hour - 1.0)
        std.append(found.capacity_std_ampere_hour[-1] / plant.capacity_ampere_hour)
    return float(np.sqrt(np.average(np.square(off), weights=np.power(std, -2.0))))


def as_filtered(model, name, record):
    """Bank of a member, a record as a filter takes it, and how its current runs between samples.

    Parameters
    ----------
    model, name : as in `bank_of`. record : Record.

    Returns
    -------
    bank : Bank at the record's mean temperature under load.
    record : Record without the instrument's errors that the member states, its resistance factor
        that over the bank's.
    hold : how its current runs between two samples.
    """
    size, entry = model["capacity_ampere_hour"], member_of(model, name)
    celsius = loaded_mean(record.current_ampere, record.celsius, size)
    hold = hold_of(entry, record.current_ampere)
    read = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
    _, charging, soc = corrected(entry, size, *read, kind=record.kind)
    ready = record._replace(
        current_ampere=charging,
        voltage_volt=true_volt(entry, record.voltage_volt),
        soc=soc,
        resistance_factor=resistance_factor_of(model, name, record.celsius, celsius),
    )
    return bank_of(model, name, celsius), ready, hold


# ASSUME: A model errs under other loads by as much as under the loads it was fitted to.
def learnt_at(member, celsius, *, capacity_known=True):
    """Noise that was learnt at the temperatures of a member, between them straight in logarithms.

    Parameters
    ----------
    member : dict of a model file. celsius : scalar [degC]. capacity_known : it is no state.

    Returns
    -------
    noise : dict of fields of `Noise`; empty where nothing was learnt.
    """
    told = [c for c in member["conditions"] if c.get("noise")]
    if not told:
        return {}
    known = np.array([stated_or_reference(c["ambient_temperature_celsius"]) for c in told])
    order = np.argsort(known)
    noise = {}
    for name in LEARNT:
        values = np.log([told[k]["noise"][name] for k in order])
        noise[name] = float(np.exp(np.interp(celsius, known[order], values)))
    if capacity_known:
        return noise | {"steady_error": 0.0, "least_rest_volt": LEAST_VOLT}
    # One reading is no deviation: those of all temperatures are.
    misread = rms([c["noise"]["capacity_misread"] * _unseen(c) for c in told])
    return noise | DOUBTED | {"capacity_misread": misread}


def _fitted(record):
    """Rows (n,) that no score is taken from; a row that is only unsettled tells its noise."""
    return record.used | (record.role != "split")


def _unseen(condition):
    """Error of a model on what it was not fitted to over that of its fit."""
    usual = condition.get("left_out_usual_volt")
    return UNSEEN if usual is None else max(1.0, usual / max(condition["fit_rmse_volt"], 1e-9))


def _searched(stretches, low, high):
    """Logarithms of the likeliest values."""
    before = np.log([getattr(Noise(), name) for name in LEARNT])
    values = np.clip(before, low, high)

    def cost(tried):
        return _cost(tried, stretches) + 0.5 * np.sum(((tried - before) / DOUBT) ** 2)

    # Here, for its import takes longer than many a job.
    from scipy.optimize import minimize

    found = minimize(
        cost, values, method="Powell", bounds=list(zip(low, high, strict=True)), tol=TOLERANCE
    )
    return np.clip(found.x, low, high)


def _cost(values, stretches):
    """Minus the logarithm of the likelihood of all innovations, but for a constant."""
    found = dict(zip(LEARNT, np.exp(values).tolist(), strict=True))
    skew = found["skew_second"]
    noise = Noise(**found, adaptive=False, soc_walk=(0.0, 0.0))
    total = 0.0
    for stretch in stretches:
        fast = (noise.resistance_error * stretch.at_once_volt) ** 2
        plant = stretch.plant._replace(
            white_variance=noise.sensor_volt**2,
            fast_variance=fast,
            slow_variance=stretch.load_volt**2,
            edge_variance=stretch.edge_variance(skew),
        )
        variances = np.array([SURE, plant.slow_variance, fast, 1.0])
        mean = np.array([stretch.soc, 0.0, 0.0, 0.0])
        nothing = np.empty((0, 3))
        at_first = State(mean, np.diag(variances), 0.0, variances[1], nothing, mean[0], 0.0, SURE)
        innovation, variance = run(plant, noise, at_first)[1:, 2:4].T
        total += 0.5 * np.sum(innovation**2 / variance + np.log(variance))
    return total


def _stretches(model, name, record, most):
    """Misfits of a record, at most so many rows of it, and the level of its overpotentials [V]."""
    bank, ready, hold = as_filtered(model, name, record)
    columns = (record.test_time_second, record.current_ampere)
    run_of_model = simulate_model(
        model, name, *columns, record.soc, record.celsius, kind=record.kind
    )
    missed = np.ascontiguousarray(record.voltage_volt - run_of_model.voltage_volt)
    factor = {"resistance_factor": ready.resistance_factor}
    whole = plant_of(bank, *columns, missed, Noise(), hold=hold, **factor)
    levels = levels_of_plant(bank, whole)
    # The SoC is counted by the record, of which rows were left out where nothing stepped.
    counted = np.diff(record.soc, prepend=record.soc[0]) * bank.capacity_ampere_hour
    passed = np.maximum(whole.passed_ampere_hour, np.abs(counted))
    whole = _without_circuit(whole)._replace(charge_ampere_hour=counted, passed_ampere_hour=passed)
    edges = {}

    def edge_variance(skew_second):
        if skew_second not in edges:
            columns = whole.step_second, whole.current_ampere
            edge = edges_of(bank, levels, *columns, skew_second, hold=hold)
            edges[skew_second] = np.where(_fitted(record), edge, UNREAD)
        return edges[skew_second]

    at_once = float(levels @ [element.direct for element in bank.elements])
    load = max(load_error_volt(bank, levels), Noise().least_error_volt)
    found = [
        Misfit(
            piece_of(whole, rows),
            lambda skew, rows=rows: np.ascontiguousarray(edge_variance(skew)[rows]),
            float(record.soc[rows.start]),
            at_once,
            load,
        )
        for rows in _rows_looked_at(len(record.soc), most)
    ]
    return found, float(levels.sum())


def _rows_looked_at(count, most):
    """Slices of a record: all of it, or stretches that are spread over it."""
    if count <= max(most, WINDOW):
        return [slice(0, count)]
    starts = np.linspace(0, count - WINDOW, max(most // WINDOW, 1)).astype(int)
    return [slice(int(start), int(start) + WINDOW) for start in starts]


def _without_circuit(plant):
    """The plant of a voltage that is all misfit: no OCV, no element, the errors as states."""
    tables = plant.tables[:, : ERROR + 1].copy()
    tables[:, :ERROR] = 0.0
    tables[:, ERROR] = np.maximum(tables[:, ERROR], LEAST_VOLT)
    none, integers = np.empty(0), np.empty(0, np.int64)
    return plant._replace(
        tables=np.ascontiguousarray(tables),
        shifts_soc=integers,
        direct=none,
        source=integers,
        by_charge=integers,
        drives=np.empty((0, *plant.drives.shape[1:])),
        largest=none,
        usual_gain=none,
        element=integers,
        share=none,
        moves=integers,
        size=4,
        error=1,
        fast=2,
        standing=3,
        capacity=-1,
        ohmic=-1,
    )
