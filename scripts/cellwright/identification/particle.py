"""Fit of a particle with charge transfer to the records of all temperatures at once.

Damped Gauss-Newton steps with exact derivatives, about priors that are wide where records tell a
parameter and physical where they do not: pulses of ten seconds tell no energy of diffusion. The sum
of squares is held in where a row misses by more than its error, for near empty every model does.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS, ocv_on_grid, usual_slope
from cellwright.circuits.particle import PARTS, SCALES, Particle, layout, run
from cellwright.circuits.temperature import ocv_at
from cellwright.identification.choice import FOLDS, score_of
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.records.record import Record
from cellwright.records.thinning import averaged_to, edge_ampere, thin, without_edges
from cellwright.refusal import Refusal

MOST_ROWS = 12_000  # of all records of a fit together
GROWTH = 0.25  # of the time since a step of the current, from one row to the next
# Neighbouring rows err alike: so many say what one does, and so long a time of a drive.
ROWS_ALIKE, ALIKE_SECOND = 16.0, 40.0
READING_VOLT = 3e-3  # error of a row: of the reading, of its overvoltage and of its SoC
OVER_SHARE, SOC_ERROR = 0.03, 0.003
FAR = 4.0  # errors of a row, from which on it weighs ever less
LONG_LOAD = 2.0  # weight of capacity tests: they alone say where the cell ends
CELL_AMPERE_HOUR = 2.9  # of the cell whose resistances the priors state
STARTS_JOULE_PER_MOLE = (20e3, 50e3)  # energies of diffusion, between which two basins lie
# A fit begins with diffusion that is faster than its prior says, by so much of ln(D/R²): one that
# begins too slow empties the surface of the particle in the cold, and ends where it cannot return.
FASTER_AT_START = 1.5
FIRST_STEPS, STEPS, STEPS_WITHOUT = 12, 40, 6  # of each start, of the best, without a fold
SETTLED = 3e-4  # relative fall of the cost below which a fit ends
LEAST_DAMPING, MOST_TRIES = 1e-7, 8
LARGEST_ERROR = 200.0  # of a row, in its deviations, where a try runs away
FARTHEST = 1.5  # standard deviations of its prior that a parameter moves in a step


class Prior(NamedTuple):
    """Mean and standard deviation of a parameter, of its logarithm where that is fitted.

    walk : over SoC, standard deviation of the change over the whole range; it may be faster near
        empty. None: one number.
    """

    mean: float
    std: float
    walk: float | None = None


def _resistance(ohm, std, walk, energy, energy_std, name):
    return {
        f"{name}_ohm": Prior(np.log(ohm), std, walk),
        f"{name}_joule_per_mole": Prior(energy, energy_std),
        f"{name}_bend_joule_per_mole": Prior(0.0, 15e3),
    }


def _lag(ohm, second, name):
    return _resistance(ohm, 1.5, 2.0, 30e3, 20e3, name) | {
        f"{name}_second": Prior(np.log(second), 1.0),
        f"{name}_second_joule_per_mole": Prior(10e3, 15e3),
    }


# ASSUME: Priors of the particle: what cells of graphite with layered oxides or iron phosphate
# show, for a cell of 2.9 Ah; resistances scale with its capacity. Records mostly tell far more.
PRIORS = {
    "diffusion_per_second": Prior(-9.0, 3.0, 3.0),
    "diffusion_joule_per_mole": Prior(38e3, 8e3),
    **_resistance(0.015, 2.0, 2.5, 50e3, 15e3, "transfer"),
    "double_layer_farad": Prior(np.log(20.0), 1.5),
    "double_layer_joule_per_mole": Prior(0.0, 3e3),
    "transfer_scale": Prior(np.log(2.0), 0.5),
    **_resistance(0.02, 1.0, 0.6, 12e3, 10e3, "r0"),
    **_lag(0.01, 20.0, "fast"),
    **_lag(0.01, 300.0, "slow"),
    "ocv_shift_volt": Prior(0.0, 0.03, 0.06),
    "ocv_volt_per_kelvin": Prior(0.0, 3e-4, 6e-4),
    "hysteresis_volt": Prior(0.0, 0.01, 0.02),
    "missing": Prior(0.0, 0.02),
    "stretch": Prior(0.0, 0.05),
}


# Parts of the particle, and how it is without each: parameters at the value of the vector at which
# the part does nothing, None: at one value for all their knots. Diffusion evens out within a second
# at any temperature; the overvoltage is in proportion to the current up to some 25 V. Charge
# transfer settles within a second in warmth and takes ten in the cold: who looks at what acts at
# once and at what relaxes sees it in both.
WITHOUT = {
    "diffusion": {"diffusion_per_second": 0.0, "diffusion_joule_per_mole": 0.0},
    "kinetics": {"transfer_scale": np.log(1e3)},
    "temperature": {part.name: 0.0 for part in PARTS if part.unit == "J/mol"},
    "ohmic_soc": dict.fromkeys(("r0_ohm", "transfer_ohm")),
    "relaxing_soc": dict.fromkeys(("transfer_ohm", "fast_ohm", "slow_ohm")),
    "entropy": {"ocv_volt_per_kelvin": 0.0},
    "scale_temperature": dict.fromkeys(SCALES),
    "scale": dict.fromkeys(SCALES, 0.0),
    "hysteresis": {"hysteresis_volt": 0.0},
    "shift": {"ocv_shift_volt": 0.0},
}
OVER_TEMPERATURE = ("temperature", "entropy", "scale_temperature")  # which one temperature lacks
HELD = 1e-3  # deviations of its prior, by which a parameter may leave where it is held


class Rows(NamedTuple):
    """A record as it is fitted: Record, the standard deviation of each used row [V], the weight of
    a row, and the fold of each used row, -1 where it is never left out."""

    record: Record
    std_volt: np.ndarray
    weight: float
    fold: np.ndarray


class Task(NamedTuple):
    """What a fit is about: list of Rows, the particle to begin from, the capacity [Ah], and mean,
    deviation (p,) and precision (p, p) of the prior."""

    rows: list
    start: Particle
    capacity_ampere_hour: float
    mean: np.ndarray
    std: np.ndarray
    precision: np.ndarray


class Fitted(NamedTuple):
    """A fitted particle, standard deviations (p,) of its vector, and by start the energy of
    diffusion [J/mol] and the cost at which it stood when the best of them was followed."""

    particle: Particle
    std: np.ndarray
    basins: tuple


def of_lone_loads(by_temperature):
    """Conditions of a task from temperatures of which nothing else is fitted; none is left out.

    Parameters
    ----------
    by_temperature : list of FitRecords of long loads, see `records.record.lone_loads`.
    """
    return [
        (one.celsius, *[list(one.records)] * 2, [np.zeros(r.used.sum(), int) for r in one.records])
        for one in by_temperature
    ]


def task_of(conditions, curves, *, capacity_ampere_hour):
    """What a particle is fitted to.

    Parameters
    ----------
    conditions : list, by temperature, of (celsius, list of Record, list of Record as others are
        fitted to them, list of (used rows,) their blocks), coldest first.
    curves : list of dict, OCV tables with a temperature each.
    capacity_ampere_hour : [Ah].

    Returns
    -------
    task : Task.
    """
    celsius = np.array([condition[0] for condition in conditions])
    grid = np.linspace(0.0, 1.0, POINTS)
    ocv_volt = ocv_at(curves, grid, REFERENCE_CELSIUS)
    mean, std, precision = _prior(len(celsius), capacity_ampere_hour)
    start = Particle(ocv_volt, celsius, mean)
    pairs = [
        pair
        for _, records, ready, blocks in conditions
        for pair in zip(_thinned(records, capacity_ampere_hour), ready, _folds(blocks), strict=True)
    ]
    steady = [pair for pair in pairs if pair[0].kind != "drive"]
    taken = sum(len(record.soc) for record, *_ in steady)
    drives = [pair for pair in pairs if pair[0].kind == "drive"]
    if drives:
        most = max(MOST_ROWS - taken, MOST_ROWS // 4, len(drives))
        fewer = averaged_to([record for record, *_ in drives], most_rows=most)
        drives = [(record, *about) for record, (_, *about) in zip(fewer, drives, strict=True)]
    rows = [_rows(*pair, ocv_volt) for pair in (*steady, *drives)]
    return Task(rows, start, capacity_ampere_hour, mean, std, precision)


def _thinned(records, capacity):
    """Records of a temperature, drives as they are, of others fewer rows.

    A current steps by a share of the largest of all records of a kind: by that of the weakest load
    a current that flickers never rests, and all its rows would stay.
    """
    step = {}
    for record in records:
        step[record.kind] = max(edge_ampere(record), step.get(record.kind, 0.0))
    along = {"growth": GROWTH, "capacity_ampere_hour": capacity}
    return [
        record
        if record.kind == "drive"
        else without_edges(
            thin(record, step_ampere=step[record.kind] / 10, **along),
            step_ampere=step[record.kind],
        )
        for record in records
    ]


def _folds(blocks):
    """Fold of each used row of some records, by their blocks; -1 where there is only one block."""
    numbers, index = np.unique(np.concatenate(blocks), return_inverse=True)
    fold = index % min(FOLDS, len(numbers)) if len(numbers) > 1 else np.full(len(index), -1)
    return np.split(fold, np.cumsum([len(block) for block in blocks])[:-1])


def _rows(record, ready, fold, ocv_volt):
    """Rows of a record; a row is of the fold of the last ready row before it."""
    used, soc = record.used, record.soc[record.used]
    before = np.searchsorted(
        ready.test_time_second[ready.used], record.test_time_second[used], side="right"
    )
    over = record.voltage_volt[used] - ocv_on_grid(ocv_volt, soc)
    slope = usual_slope(ocv_volt, np.clip(soc, 0.0, 1.0))
    std = np.sqrt(READING_VOLT**2 + (OVER_SHARE * over) ** 2 + (SOC_ERROR * slope) ** 2)
    weight = (LONG_LOAD**2 if record.kind == "capacity" else 1.0) / ROWS_ALIKE
    if record.kind == "drive":  # a row stands for all that its mean is of
        weight = max(float(np.median(np.diff(record.test_time_second))), 1.0) / ALIKE_SECOND
    return Rows(record, std, weight, fold[np.maximum(before - 1, 0)])


def _prior(temperatures, capacity):
    """Mean and deviation (p,) of the vector's prior, and its precision with the walks over SoC."""
    places, size = layout(temperatures), CELL_AMPERE_HOUR / capacity
    length = max(place.stop for place in places.values())
    mean, std = np.empty(length), np.empty(length)
    for name, place in places.items():
        mean[place], std[place] = PRIORS[name].mean, PRIORS[name].std
        if name.endswith("_ohm") or name.endswith("_farad"):
            mean[place] += np.log(size) * (1.0 if name.endswith("_ohm") else -1.0)
    precision = np.diag(std**-2.0)
    for part in PARTS:
        if PRIORS[part.name].walk is None:
            continue
        knots, place = np.array(part.knots, float), places[part.name]
        # Near empty a course may change as fast per ten per cent of the SoC as elsewhere in all.
        path = np.diff(knots) + 0.1 * np.diff(np.log(knots + 0.02))
        walk = (
            np.diff(np.eye(len(knots)), axis=0) / (PRIORS[part.name].walk * np.sqrt(path))[:, None]
        )
        precision[place, place] += walk.T @ walk
    return mean, std, precision


def fitted(task):
    """The most likely particle of several starts.

    Parameters
    ----------
    task : Task.

    Returns
    -------
    fitted : Fitted.

    Raises
    ------
    Refusal : no row, or no start ends at numbers.
    """
    places = layout(len(task.start.celsius))
    place = places["diffusion_joule_per_mole"]
    energies = STARTS_JOULE_PER_MOLE if len(task.start.celsius) > 1 else (task.mean[place][0],)
    begun = []
    for energy in energies:
        vector = task.mean.copy()
        vector[place] = energy
        vector[places["diffusion_per_second"]] += FASTER_AT_START
        begun.append(_walked(task, vector, steps=FIRST_STEPS))
    vector, cost, precision = _walked(task, min(begun, key=lambda end: end[1])[0], steps=STEPS)
    if not np.isfinite(cost):
        raise Refusal("no particle can be fitted: its cost is no number from any start")
    std = np.sqrt(np.diag(np.linalg.inv(precision)))
    basins = tuple((float(end[0][place][0]), float(end[1])) for end in begun)
    return Fitted(task.start._replace(vector=vector), std, basins)


def left_out_without(task, particle, part, conditions):
    """Errors of blocks as of `left_out`, by a particle of which a part is taken out.

    The rest is fitted anew from where the particle stands: from the starts of `fitted` it ends at
    the same errors (within .4 mV on Panasonic's pulses at every temperature; without any activation
    energy within 4 of 31 to 217 mV) and takes three times as long.

    Parameters
    ----------
    task, conditions : as of `left_out`. particle : Particle, fitted. part : name in `WITHOUT`.

    Returns
    -------
    scores : list of choice.Score, one a temperature.
    """
    vector, mean, precision = particle.vector.copy(), task.mean.copy(), task.precision.copy()
    for name, value in WITHOUT[part].items():
        place = layout(len(particle.celsius))[name]
        held = np.eye(place.stop - place.start) / (HELD * task.std[place])
        if value is None:
            vector[place], held = vector[place].mean(), np.diff(held, axis=0)
        else:
            vector[place] = mean[place] = value
        precision[place, place] += held.T @ held
    bare = task._replace(mean=mean, precision=precision)
    vector, *_ = _walked(bare, vector, steps=STEPS)
    return left_out(bare, Fitted(particle._replace(vector=vector), None, ()), conditions)


def left_out(task, fit, conditions):
    """Errors of blocks, each predicted by a particle fitted without its fold.

    Parameters
    ----------
    task : Task. fit : Fitted, from which each of these fits begins. conditions : as in `task_of`.

    Returns
    -------
    scores : list of choice.Score, one a temperature.
    """
    folds = [_folds(blocks) for *_, blocks in conditions]
    errors = [[np.zeros(len(fold)) for fold in of_condition] for of_condition in folds]
    for number in range(FOLDS):
        vector, *_ = _walked(task, fit.particle.vector, steps=STEPS_WITHOUT, without=number)
        particle = task.start._replace(vector=vector)
        for of_condition, folded, (_, _, ready, _) in zip(errors, folds, conditions, strict=True):
            for error, fold, record in zip(of_condition, folded, ready, strict=True):
                here = fold == number
                if here.any():
                    volt = _simulated(task, particle, record).voltage_volt
                    error[here] = (record.voltage_volt - volt)[record.used][here]
    return [
        score_of(np.concatenate(blocks), np.concatenate(of_condition))
        for of_condition, (*_, blocks) in zip(errors, conditions, strict=True)
    ]


def _simulated(task, particle, record, **settings):
    columns = record.test_time_second, record.current_ampere, record.soc, record.celsius
    return run(particle, *columns, capacity_ampere_hour=task.capacity_ampere_hour, **settings)


def _walked(task, vector, *, steps, without=None):
    """Vector after damped steps, its cost, and the curvature of half of that there."""
    damping = 1e-2
    # Nearly every try is taken: its derivatives are made at once.
    cost, precision, slope = _curved(task, vector, without)
    for _ in range(steps):
        for _ in range(MOST_TRIES):
            damped = precision + damping * np.diag(np.diag(precision))
            step = np.linalg.solve(damped, slope)
            tried = vector + np.clip(step, -FARTHEST * task.std, FARTHEST * task.std)
            end = _curved(task, tried, without)
            if end[0] < cost:
                break
            damping *= 4.0
        else:
            break
        fell, vector, damping = cost - end[0], tried, max(damping / 5.0, LEAST_DAMPING)
        cost, precision, slope = end
        if fell < SETTLED * cost:
            break
    return vector, cost, precision


def _curved(task, vector, without):
    """Cost of a vector, half of its second derivative (p, p), and minus half of its first (p,)."""
    particle = task.start._replace(vector=vector)
    off = vector - task.mean
    cost, slope, precision = (
        off @ task.precision @ off,
        -task.precision @ off,
        task.precision.copy(),
    )
    for rows in task.rows:
        simulated = _simulated(task, particle, rows.record, derivatives=True)
        kept = _kept(rows, without)
        error = _relative_error(rows, simulated.voltage_volt)[kept]
        weight = np.sqrt(rows.weight / (1.0 + (error / FAR) ** 2))
        by = simulated.by[np.flatnonzero(rows.record.used)[kept]]
        by *= (weight / rows.std_volt[kept])[:, None]
        cost += rows.weight * _held_in(error).sum()
        precision += by.T @ by
        slope += by.T @ (weight * error)
    return cost, precision, slope


def _kept(rows, without):
    """Which used rows take part where a fold is left out."""
    return slice(None) if without is None else rows.fold != without


def _relative_error(rows, volt):
    error = (rows.record.voltage_volt - volt)[rows.record.used] / rows.std_volt
    return np.clip(np.nan_to_num(error, nan=LARGEST_ERROR), -LARGEST_ERROR, LARGEST_ERROR)


def _held_in(error):
    """Square of small errors, growing ever slower beyond `FAR` (Cauchy's loss)."""
    return FAR**2 * np.log1p((error / FAR) ** 2)


def information(task, particle):
    """What the rows of a task tell of the numbers of a particle, were they as it simulates them.

    Parameters
    ----------
    task : Task, of which the prior is left aside. particle : Particle, also at other temperatures.

    Returns
    -------
    precision : (p, p) that the rows add to that of the particle's vector.
    """
    nothing = np.zeros((len(particle.vector), len(particle.vector)))
    bare = task._replace(start=particle, mean=particle.vector, precision=nothing)
    return _curved(bare, particle.vector, None)[1]


def root_of_covariance(task, fit):
    """Lower triangular root (p, p) of the covariance of a fitted particle's vector.

    It takes the structure for right: what the records and the priors leave open.

    Parameters
    ----------
    task : Task. fit : Fitted.
    """
    precision = task.precision + information(task, fit.particle)
    return np.linalg.cholesky(np.linalg.inv(precision))
