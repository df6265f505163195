"""Error of a fitted model on records that took no part in its fit, and where it lies."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, beginning
from cellwright.effects.score import BANDS, LEAST_ROWS
from cellwright.numerics.least_squares import Free, bounded_minimum, inverse
from cellwright.numerics.statistics import rms
from cellwright.records.conditions import low_current

READ_VOLT = 2e-3  # of a single reading at rest
LEAST_SLOPE_VOLT = 1e-3  # of the OCV over the whole SoC; below it a rest shows no SoC
PASSES = 3
SETTLED_SOC = 1e-5  # a change below it ends them
SOC_STEP, KELVIN_STEP = 2e-4, 0.5
# ASSUME: The core of a cell is above its surface by 6 K for a watt and an ampere-hour of capacity,
# 300 s after the load. Cells of 2.3 Ah (26650) have 2 to 3.3 K/W (X. Lin et al., J. Power Sources
# 257 (2014) 1; C. Forgez et al., J. Power Sources 195 (2010) 2961).
CORE_KELVIN_AMPERE_HOUR_PER_WATT, CORE_SECOND = 6.0, 300.0
CORE_STEP = 0.5  # K/W, for derivatives
# Of what is known before a fit: of some dozens of records none lies farther off by chance.
FAR_STDS = 3.0
ALIKE_SOC = 0.02  # between two rests whose OCV errs alike
RATE_CLASSES = (0.05, 0.7)  # C, between rest, low and high rates of a residual map
RATES = ("rest", "discharge_low", "discharge_high", "charge_low", "charge_high")


class Rests(NamedTuple):
    """First rests of fitted records: their SoC [1], and the mean error of the model in each [V]."""

    soc: np.ndarray
    error_volt: np.ndarray


def rests_of(cell, stack, solution):
    """SoC and mean error of the first rests of the records that were fitted: Rests.

    Their SoC at the start was fitted to all of their rows, so that the residual of these rests is
    the error of the OCV there; it is steepest, and least certain, where most records begin.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. solution : least_squares.Solution of it.

    Returns
    -------
    rests : Rests.
    """
    loaded = _loaded(cell, stack)
    rows = {k: first_rest(stack, k, loaded) for k in range(len(stack.first))}
    rows = {k: rest[stack.used[rest]] for k, rest in rows.items()}
    files = [k for k, rest in rows.items() if len(rest)]
    soc = np.array([solution.values[f"soc0[{k}]"] for k in files])
    return Rests(soc, np.array([solution.residual[rows[k]].mean() for k in files]))


def started(cell, stack, values, effects, tolerance, shared=(), rests=None):
    """Values with the SoC at the start of each record: of its first rest and as stated, weighted.

    Nothing else of these records enters a parameter.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. values : dict. effects : sequence of Effect.
    tolerance : base.Tolerance. shared : (number here, number in the fit) of records of which one
        part was fitted and another judges: they have one start, that of the fit.
    rests : Rests of the records fitted: a rest at a SoC near by is taken to have their error.

    Returns
    -------
    values : dict, with the starts of this stack in the place of others.
    """
    # Within the tolerance: a model that lacks an effect may fit a start far beyond it.
    least, most = stack.soc_at_start - tolerance.soc, stack.soc_at_start + tolerance.soc
    shared_starts = {
        f"soc0[{k}]": float(np.clip(values[f"soc0[{n}]"], least[k], most[k])) for k, n in shared
    }
    values = values | base.stated_starts(stack) | shared_starts
    loaded = _loaded(cell, stack)
    rests_of_files = [first_rest(stack, k, loaded) for k in range(len(stack.first))]
    # Only these rows are looked at: to simulate whole records for them takes three times as long.
    ends = [rows[-1] + 1 if len(rows) else 0 for rows in rests_of_files]
    stack, moved_up = stack.first_rows(ends)
    for _ in range(PASSES):
        earlier = values
        error = stack.voltage_volt - base.voltage(cell, stack, values, effects)
        for k in range(len(stack.first)):
            name, stated = f"soc0[{k}]", stack.soc_at_start[k]
            rest = rests_of_files[k] - moved_up[k]
            beyond = error[rest] - _error_near(values[name], rests)
            soc = _start_soc(cell, values[name], stated, beyond, tolerance)
            values = values | {name: shared_starts.get(name, soc)}
        starts = base.start_names(len(stack.first))
        if max(abs(values[name] - earlier[name]) for name in starts) < SETTLED_SOC:
            break
    return values


def unfitted(case):
    """The plain model of a case before any fit: first values, and its free parameters.

    The SoC at the start of a record stays between what its first rest and the sheet tell, and what
    the rest leaves unsure beyond. A start that followed the load would take up what the model
    lacks: a cell whose resistance doubles in the cold would begin its cold records at 92 % instead
    of 99. The sheet is as good an end as the rest, for a rest may be off by hysteresis.

    Parameters
    ----------
    case : case.Case.

    Returns
    -------
    values : dict. free : tuple of Free.
    """
    cell, stack, tolerance = case.cell, case.fit, case.tolerance
    values = case.start or beginning.first_values(cell, stack, capacity=case.first_capacity)
    values = started(cell, stack, values, (), tolerance)
    stds = _start_stds(cell, stack, values, tolerance)
    starts = []
    for k, (stated, std) in enumerate(zip(stack.soc_at_start, stds, strict=True)):
        name = f"soc0[{k}]"
        ends = sorted((stated, values[name]))
        limits = ends[0] - FAR_STDS * std, ends[1] + FAR_STDS * std
        starts.append(Free(name, SOC_STEP, stated, tolerance.soc, *limits))
    free = base.frees(stack, values, tolerance, case.log_std, starts)
    capacity = next(one for one in free if one.name == "capacity")
    if case.first_capacity:
        # What all records contradict is not known beforehand. It is known as finely as it was
        # looked for: the declared one would have the OCV, at its own tolerance, take up what is
        # wrong.
        finest = beginning.FINER_CAPACITY
        capacity = capacity._replace(prior=case.first_capacity, std=finest)
    limits = _declared_limits(case, capacity)
    free = [capacity if one.name == "capacity" else one for one in free]
    return values, tuple(one._replace(**limits.get(one.name, {})) for one in free)


def _declared_limits(case, capacity):
    """Bounds of what was declared with a tolerance, capacity and OCV, by parameter's name.

    Without them whatever the model lacks ends there: beside misfit of tens of millivolts their
    priors weigh nothing. Nor is it a tolerance where the slow test's two branches are not fitted
    beside the others: an OCV of one branch, of rests, or of another cell may hold half a
    hysteresis, and its scale of the SoC, too.
    """
    if not case.holds_declared:
        return {}
    farthest = FAR_STDS * base.ocv_stds(case.cell, case.tolerance)
    knots = zip(base.OCV_NAMES, farthest.tolist(), strict=True)
    limits = {name: {"lower": -most, "upper": most} for name, most in knots}
    (lower, upper), far = sorted((0.0, capacity.prior)), FAR_STDS * capacity.std
    return limits | {"capacity": {"lower": lower - far, "upper": upper + far}}


class Unsure(NamedTuple):
    """What is unsure of the validation records: the SoC at a start, a temperature, a template.

    changes : (m, p) of the prediction for one unit of each in all records at once. stds : (f, p) of
    each in each record. file : (m,) number of the record of each row. alone : numbers of the
    records of which no part was fitted. of_temperature : the last of them is the temperature.
    """

    changes: np.ndarray
    stds: np.ndarray
    file: np.ndarray
    alone: frozenset
    of_temperature: bool = False

    def errors_in(self, error, whitening):
        """Errors (f, p) of what is unsure that explain most of an error (m,), each within
        `FAR_STDS` deviations.

        A start that is known to a millivolt moves the whole record by as much. That is no error of
        the model; counted as such, it would be proof of an effect that also moves whole records.
        Errors beyond what the rest and the sheet leave open are attributed to the model.
        """
        both = whitening.apply(np.column_stack([self.changes, error]))
        errors = np.zeros_like(self.stds)
        for k, rows in self._rows():
            columns, rest, limit = both[rows, :-1], both[rows, -1], FAR_STDS * self.stds[k]
            precision = columns.T @ columns + np.diag(self.stds[k] ** -2.0)
            errors[k] = bounded_minimum(precision, columns.T @ rest, -limit, limit)
        return errors

    def change_by(self, errors):
        """Change (m,) of the prediction by errors (f, p)."""
        return np.sum(self.changes * errors[self.file], axis=1)

    def taken_out_of(self, columns, whitening):
        """Whitened columns (m, k), less what errors of what is unsure would explain of them."""
        changes, columns = whitening.apply(self.changes), columns.copy()
        for k, rows in self._rows():
            mine = changes[rows]
            precision = mine.T @ mine + np.diag(self.stds[k] ** -2.0)
            columns[rows] -= mine @ np.linalg.solve(precision, mine.T @ columns[rows])
        return columns

    def _rows(self):
        return [(k, self.file == k) for k in sorted(self.alone)]


def unsure_of(cell, stack, values, effects, tolerance, prediction, shared=()):
    """What is unsure of each record that judges, and what it changes: Unsure.

    These are the SoC at its start; beside healthy cells the scale of their template; and last,
    where no sensor told any record's and effects are in the model, its temperature.

    Parameters
    ----------
    cell, stack, effects, tolerance, shared : as in `started`. values : with the starts of
    `started`. prediction : (n,) voltage at them [V].
    """
    starts = base.start_names(len(stack.first))
    by_start = values | {name: values[name] + SOC_STEP for name in starts}
    changes = [(base.voltage(cell, stack, by_start, effects) - prediction) / SOC_STEP]
    unsure = [_start_stds(cell, stack, values, tolerance)]
    if stack.template_volt.any():
        changes.append(stack.template_volt)
        unsure.append(np.full(len(starts), tolerance.known))
    # An error of a stated temperature changes nothing of the plain model's prediction.
    of_temperature = bool(effects) and bool(stack.stated.any())
    if of_temperature:
        warmer = stack.celsius + KELVIN_STEP * stack.stated[stack.file]
        warmed = stack._replace(celsius=warmer, responses={}, courses={})
        changes.append((base.voltage(cell, warmed, values, effects) - prediction) / KELVIN_STEP)
        unsure.append(np.full(len(starts), tolerance.kelvin))
    alone = frozenset(range(len(starts))) - {k for k, _ in shared}
    columns = np.stack(changes, axis=1), np.stack(unsure, axis=1)
    return Unsure(*columns, stack.file, alone, of_temperature)


def unsure_by_temperature(case, state, whitening):
    """What unknown temperatures leave unsure of the parameters of a fitted model.

    The fit takes them as stated or logged. A cell that was 2 K warmer than its chamber on one of
    two records 15 K apart shows an activation energy that is a tenth too small, however well both
    are followed; and a cell's core is warmer than its surface, the more so in the cold.

    Parameters
    ----------
    case : case.Case. state : state.State of the model. whitening : noise.Whitening of its fit.

    Returns
    -------
    covariance : (p, p), in the order of `state.solution.names`.
    """
    stack, solution = case.fit, state.solution
    if not state.effects:
        return np.zeros((len(solution.names),) * 2)
    tolerances, changes = [], []
    if stack.stated.any():
        of_record = stack.file[:, None] == np.flatnonzero(stack.stated)
        stated = _change_of_warming(case, state, KELVIN_STEP * stack.stated[stack.file])
        changes += list((stated[:, None] * of_record / KELVIN_STEP).T)
        tolerances += [case.tolerance.kelvin] * of_record.shape[1]
    if not any(effect.warms_core for effect in state.effects):
        rise = CORE_STEP * _core_per_watt(case, state)
        changes.append(_change_of_warming(case, state, rise) / CORE_STEP)
        tolerances.append(CORE_KELVIN_AMPERE_HOUR_PER_WATT / case.cell.capacity_ampere_hour)
    if not changes:
        return np.zeros((len(solution.names),) * 2)
    white = whitening.apply(np.stack(changes, axis=1) * tolerances)
    answers = inverse(solution.precision) @ (solution.white.T @ white)
    return answers @ answers.T


def _change_of_warming(case, state, kelvin):
    """Change (n,) of a model's voltage on the records fitted where they are warmer by (n,) [K]."""
    warmed = case.fit._replace(celsius=case.fit.celsius + kelvin, responses={}, courses={})
    values = state.solution.values
    return base.voltage(case.cell, warmed, values, state.effects) - state.solution.prediction


def _core_per_watt(case, state):
    """Rise (n,) of the core of a cell on the records fitted, for one kelvin a watt [K]."""
    stack = case.fit
    fields = base.fields_of(case.cell, stack, state.solution.values, state.effects)
    heat = fields.current * (fields.ohmic + base.slow_volt(stack, fields))
    return base.relaxed(stack, heat, CORE_SECOND)


def _loaded(cell, stack):
    return ~low_current(stack.current_ampere, cell.capacity_ampere_hour)


def _error_near(soc, rests):
    """Mean error of the rests near a SoC [V], one more rest without error among them."""
    if rests is None:
        return 0.0
    near = rests.error_volt[np.abs(rests.soc - soc) <= ALIKE_SOC]
    return float(near.sum() / (len(near) + 1))


def first_rest(stack, k, loaded):
    """Rows of record k before its first load."""
    rows = np.flatnonzero(stack.file == k)
    return rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]


def _start_soc(cell, soc, stated, error, tolerance):
    """SoC at a start [1]: as stated and by the error of its rest [V], weighted."""
    slope = float(base.slopes(cell, soc))
    by_sheet, by_rest = _precisions(slope, len(error), tolerance)
    if not by_rest:
        return stated
    # No cell rests beyond full or empty, however flat the OCV is where its rest is looked up.
    at_rest = np.clip(soc + error.mean() / slope, -tolerance.soc, 1.0 + tolerance.soc)
    return (stated * by_sheet + float(at_rest) * by_rest) / (by_sheet + by_rest)


def _start_stds(cell, stack, values, tolerance):
    """Standard deviation of the SoC at the start of each record, by its rest and as stated (f,)."""
    loaded = _loaded(cell, stack)
    rows = [len(first_rest(stack, k, loaded)) for k in range(len(stack.first))]
    starts = np.array([values[name] for name in base.start_names(len(rows))])
    pairs = zip(base.slopes(cell, starts).tolist(), rows, strict=True)
    return np.array([sum(_precisions(*pair, tolerance)) ** -0.5 for pair in pairs])


def _precisions(slope, rows, tolerance):
    """Precisions of the SoC at a start: as stated, and by a rest of so many rows."""
    if not rows or abs(slope) < LEAST_SLOPE_VOLT:
        return tolerance.soc**-2.0, 0.0
    return tolerance.soc**-2.0, slope**2 / (READ_VOLT**2 / rows + tolerance.ocv_volt**2)


def rate_of(current_ampere, capacity_ampere_hour):
    """Class of the current of each row: index into RATES."""
    rate = np.asarray(current_ampere) / capacity_ampere_hour
    size = np.abs(rate)
    high = (size > RATE_CLASSES[1]).astype(int)
    return np.where(size <= RATE_CLASSES[0], 0, np.where(rate < 0, 1 + high, 3 + high))


def residual_map(stack, role, soc, before, after, capacity_ampere_hour, rows):
    """RMS and mean residual of two models [V], by record, band of the SoC and class of the rate.

    Parameters
    ----------
    stack : records.Stack. role : "fit" or "validation". soc : (n,) [1].
    before, after : (n,) residuals [V]. capacity_ampere_hour : [Ah].
    rows : (n,) bool, rows that count.

    Returns
    -------
    residuals : dict of lists, one entry a class that holds five rows or more.
    """
    band = np.clip((soc * BANDS).astype(int), 0, BANDS - 1)
    rate = rate_of(stack.current_ampere, capacity_ampere_hour)
    key = (stack.file * BANDS + band) * len(RATES) + rate
    entries = []
    for number in np.unique(key[rows]):
        inside = rows & (key == number)
        if inside.sum() < LEAST_ROWS:
            continue
        file, rest = divmod(int(number), BANDS * len(RATES))
        low, kind = divmod(rest, len(RATES))
        entries.append(
            {
                "role": role,
                "test": stack.tests[file],
                "soc_low": low / BANDS,
                "soc_high": (low + 1) / BANDS,
                "rate": RATES[kind],
                "temperature_celsius": float(stack.celsius[inside].mean()),
                "rows": int(inside.sum()),
                "before_rms_volt": rms(before[inside]),
                "before_mean_volt": float(before[inside].mean()),
                "after_rms_volt": rms(after[inside]),
                "after_mean_volt": float(after[inside].mean()),
            }
        )
    return {name: [entry[name] for entry in entries] for name in entries[0]} if entries else {}


def joined(tables):
    """Tables (dicts of lists) one below the other, without the empty ones."""
    tables = [table for table in tables if table]
    names = tables[0] if tables else ()
    return {name: [value for table in tables for value in table[name]] for name in names}


def worst(residuals, floor_volt):
    """The class with the largest share of the residual beyond the floor, or None.

    Parameters
    ----------
    residuals : dict of lists, from `residual_map`. floor_volt : [V].

    Returns
    -------
    place : dict with file, soc, current, temperature_celsius and share, as in the contract.
    """
    if not residuals:
        return None
    excess = np.array(residuals["rows"]) * np.maximum(
        np.square(residuals["after_rms_volt"]) - floor_volt**2, 0.0
    )
    if excess.sum() <= 0:
        return None
    k = int(np.argmax(excess))
    return {
        "file": residuals["test"][k],
        "soc": [residuals["soc_low"][k], residuals["soc_high"][k]],
        "current": residuals["rate"][k],
        "temperature_celsius": [residuals["temperature_celsius"][k]],
        "share": float(excess[k] / excess.sum()),
    }
