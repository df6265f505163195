"""Models of cells known only from inside a parallel group: from their branch currents.

All cells of a group see one voltage: V = f(z_c) + d_c(z_c) + R0_c(z_c)·I_c + u_c for every cell
c. With the charge of each branch counted, this is linear in the common OCV curve f (monotone), in
each cell's small deviation d_c from it, and in all resistances. u_c is that of an RC pair. Charge
transfer (Butler–Volmer), whose resistance falls with the current, fits a charge about as well and
says something else at other rates: so far the model is in doubt.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS
from cellwright.identification.cell import SCHEMA
from cellwright.numerics.lags import lag
from cellwright.numerics.linear import hats, solve
from cellwright.numerics.lines import FARADAY, GAS_CONSTANT, ZERO_CELSIUS_KELVIN
from cellwright.numerics.statistics import correlation_factor, rms
from cellwright.packs.cells import PackCells, rc_cells
from cellwright.packs.compare import passed_ampere_hour
from cellwright.packs.uncertainty.draws import SEED
from cellwright.records.conditions import (
    AT_REST_SHARE,
    REFERENCE_CELSIUS,
    stated_or_reference,
)
from cellwright.records.record import branch_currents
from cellwright.refusal import Refusal

KNOTS = 21  # of SoC, of a resistance in the model file
ALIKE = 100  # draws of cells that fit alike; they tell a standard deviation to some 5 %
DIGITS = 8  # of a number in the model file
# Of Newton's method: passes; what may still move, and how large a resistance may grow, over the
# largest of the linear pair.
ROUNDS, SETTLED, FARTHEST = 12, 1e-4, 20.0


class GroupFit(NamedTuple):
    """Identified cells (every SoC is 0 at the first sample) and how well they fit.

    cells : PackCells. fit_rmse_volt : of all cells together [V].
    r0_std_ohm, r_std_ohm, steady_std_ohm, ocv_std_volt : (cells, p) standard deviations of R0, of
    the pair's resistance, of their sum and of each cell's deviation from the common OCV.
    alike : PackCells that the charge allows as well, drawn: of each structure as many.
    """

    cells: PackCells
    fit_rmse_volt: float
    r0_std_ohm: np.ndarray
    r_std_ohm: np.ndarray
    steady_std_ohm: np.ndarray
    ocv_std_volt: np.ndarray
    alike: tuple


class _Fit(NamedTuple):
    """One structure fitted: its error [V], time constant [s], scale of its kinetics [V] (None: an
    RC pair), parameters (p,) and a root of their covariance (p, p)."""

    rmse_volt: float
    tau_second: float
    scale_volt: float | None
    parameters: np.ndarray
    root: np.ndarray


def rest_offset(branch_current_ampere, total_current_ampere, *, rest_ampere):
    """Mean branch currents over a long rest, in which nothing should flow any more.

    Parameters
    ----------
    branch_current_ampere, total_current_ampere : (n, cells), (n,) of the rest [A].
    rest_ampere : total current below which the group rests [A].

    Returns
    -------
    offset_ampere : (cells,) [A].

    Raises
    ------
    Refusal : the rows are not a rest.
    """
    # ASSUME: What a branch sensor reads at the end of a long rest of the whole group is its offset.
    if not len(total_current_ampere) or np.abs(total_current_ampere).max() > rest_ampere:
        raise Refusal(f"no rest: the total current reaches more than {rest_ampere:g} A")
    return np.mean(branch_current_ampere, axis=0)


def identify_branches(
    test_time_second,
    branch_current_ampere,
    voltage_volt,
    *,
    tau_second=(30.0, 100.0, 300.0, 1000.0, 3000.0),
    noise_ampere=0.0,
    celsius=REFERENCE_CELSIUS,
):
    """Models with one pair of all cells of a group from one full slow charge of it: GroupFit.

    The stretch starts from rest at the group's empty state and ends after its full state; between
    them the SoC of every cell runs from 0 to 1 by definition, and its charge is its capacity.

    Parameters
    ----------
    test_time_second : (n,) [s].
    branch_current_ampere : (n, cells) positive on charge, sensor offsets removed [A].
    voltage_volt : (n,) [V].
    tau_second : time constants to choose from, one for all cells [s].
    noise_ampere : scalar or (cells,) white noise of the branch sensors [A]. The voltage does not
        follow it, so that least squares on noisy currents make resistances too small, the more the
        less a current moves; the noise is taken out of the normal equations (Fuller).
    celsius : of the cells, which sets the scale of the kinetics, 2RT/F [degC].

    Raises
    ------
    Refusal : fewer than two branches, values not finite, or a branch that is not charged.

    Source: W. A. Fuller, Measurement Error Models (1987), 2.2: known variance of the errors.
    """
    # ASSUME: Cells known only from a group share one OCV curve but for a small smooth deviation;
    # their SoC 0 and 1 are the empty and full states of the group's own slow charge.
    soc, capacity = _counted(test_time_second, branch_current_ampere, voltage_volt)
    # Of the common OCV, of each cell's deviation from it and of its resistances.
    even = (np.linspace(0.0, 1.0, count) for count in (9, 5))
    knots_at = (_even_knots(soc.mean(axis=1), voltage_volt, 60), *even)
    columns = np.diff(test_time_second), branch_current_ampere, soc, voltage_volt
    noise = _noise(soc, knots_at[-1], noise_ampere)
    thermal = 2.0 * GAS_CONSTANT * (celsius + ZERO_CELSIUS_KELVIN) / FARADAY
    plain = (_fitted(columns, knots_at, tau, None, noise) for tau in tau_second)
    fit = min(plain, key=lambda one: one.rmse_volt)
    # ASSUME: A slow charge tells little of the kinetics: the plain pair is the model, and what the
    # other structure says else is its doubt.
    kinetic = _fitted(columns, knots_at, fit.tau_second, thermal, noise)
    stds = np.linalg.norm(fit.root, axis=1)
    deviation, _, (r0, pair) = _of_cells(stds, knots_at, len(capacity))
    cells, alike = (
        _cells(fit, fit.parameters, knots_at, capacity),
        _alike((fit, kinetic), knots_at, capacity),
    )
    # What one of two resistances gains the other mostly loses.
    ends = fit.root[-2 * len(capacity) * len(knots_at[-1]) :].reshape(
        len(capacity), 2, -1, len(stds)
    )
    at_knots = np.linalg.norm(ends.sum(axis=1), axis=-1)
    grid = np.linspace(0.0, 1.0, POINTS)
    steady = np.array([np.interp(grid, knots_at[-1], std) for std in at_knots])
    return GroupFit(cells, fit.rmse_volt, r0, pair, steady, deviation, alike)


def _fitted(columns, knots, tau, scale, noise):
    """A structure fitted: _Fit. Kinetics are linearised about their last resistance (Newton).

    The penalties of the fit are its priors, for errors as correlated as the residual is.
    """
    steps, current, soc, voltage = columns
    cells, ohm = soc.shape[1], np.zeros(soc.shape)
    target, tangent, most = np.tile(voltage, cells), np.ones(soc.shape), 0.0
    for _ in range(ROUNDS if scale else 1):
        if scale:
            over = ohm * current / scale
            tangent = 1.0 / np.hypot(1.0, over)
            beyond = scale * np.arcsinh(over) - tangent * ohm * current
            target = (voltage - lag(steps, tau, beyond, hold="first_order").T).ravel()
        matrix = _design(steps, current, soc, knots, tau, tangent)
        parameters, gram = _solve(matrix, target, knots, cells, noise)
        courses = parameters[-2 * cells * len(knots[-1]) :].reshape(cells, 2, -1)[:, 1]
        found = np.column_stack([hats(soc[:, c], knots[-1]) @ courses[c] for c in range(cells)])
        most = most or FARTHEST * found.max()
        found = np.minimum(found, most)
        moved, ohm = np.abs(found - ohm).max(), found
        if moved <= SETTLED * most:
            break
    error = matrix @ parameters - target
    correlated = np.mean([correlation_factor(one) for one in error.reshape(cells, -1)])
    root = np.linalg.inv(np.linalg.cholesky(gram)).T
    return _Fit(rms(error), tau, scale, parameters, rms(error) * np.sqrt(correlated) * root)


def _alike(fits, knots, capacity):
    """Cells that the charge allows as well: tuple of PackCells, of each structure as many."""
    random = np.random.default_rng(SEED)
    drawn = []
    for fit in fits:
        size = len(fit.parameters)
        normal = random.standard_normal((size, min(ALIKE // len(fits), size)))
        # At right angles few draws tell a deviation better than independent ones.
        for moved in (fit.root @ np.linalg.qr(normal)[0]).T * np.sqrt(size):
            drawn.append(_cells(fit, fit.parameters + moved, knots, capacity))
    return tuple(drawn)


def _of_cells(parameters, knots, cells):
    """Deviations of the OCV (cells, POINTS), the common OCV's increments, (R0, R1) of each cell.

    `knots` are those of the common OCV, of its deviations and of the resistances, as everywhere.
    """
    ocv, deviation, resistance = knots
    sizes = np.cumsum([cells * len(deviation), len(ocv)])
    of_ocv, common, of_resistance = np.split(parameters, sizes)
    grid = np.linspace(0.0, 1.0, POINTS)

    def on_grid(at, rows):
        return np.array([np.interp(grid, at, row) for row in rows.reshape(-1, len(at))])

    pairs = on_grid(resistance, of_resistance).reshape(cells, 2, POINTS)
    return on_grid(deviation, of_ocv), common, pairs.transpose(1, 0, 2)


def _counted(time, current, voltage):
    if np.ndim(current) != 2 or current.shape[1] < 2:
        raise Refusal("branch currents of at least two cells are needed")
    if not (np.isfinite(current).all() and np.isfinite(voltage).all()):
        raise Refusal("branch currents or voltage hold values that are not finite")
    passed = passed_ampere_hour(time, current)
    charge = np.vstack([np.zeros(current.shape[1]), np.cumsum(passed, axis=0)])
    if np.any(charge[-1] <= 0):
        raise Refusal(f"branch {int(np.argmin(charge[-1])) + 1} is not charged in this stretch")
    return charge / charge[-1], charge[-1]


def _even_knots(soc, voltage, count):
    """Knots of SoC at even distances along the OCV curve: dense where the voltage is steep."""
    # Half by SoC and half by voltage: no flat part is left without a knot.
    along = np.maximum.accumulate(soc + (voltage - voltage.min()) / np.ptp(voltage))
    along, rows = np.unique(along, return_index=True)
    middle = np.interp(np.linspace(along[0], along[-1], count)[1:-1], along, soc[rows])
    inside = middle[(middle > 0.0) & (middle < 1.0)]
    return np.unique(np.concatenate([[0.0], inside, [1.0]]))


def _design(steps, current, soc, knots, tau, tangent):
    """Columns: deviations of all cells, OCV start and increments, then (R0, R1) of each cell.

    tangent : (n, cells) what is left of R1 for a change of the current of each row [1].
    """
    (at_ocv, at_deviation, at_resistance), cells, rows = knots, soc.shape[1], []
    for c in range(cells):
        driven = hats(soc[:, c], at_resistance) * current[:, c : c + 1]
        lagged = lag(steps, tau, driven * tangent[:, c : c + 1], hold="first_order")
        resistive = np.hstack([driven, lagged])
        deviation = hats(soc[:, c], at_deviation)
        # As a start and increments, which are kept from falling: an OCV rises with SoC.
        ocv = np.cumsum(hats(soc[:, c], at_ocv)[:, ::-1], axis=1)[:, ::-1]
        # Deviation and resistances are each cell's own, the common OCV in between all cells'.
        spread = [np.kron(np.eye(cells)[c : c + 1], block) for block in (deviation, resistive)]
        rows.append(np.hstack([spread[0], ocv, spread[1]]))
    return np.vstack(rows)


def _noise(soc, knots, noise_ampere):
    """What noise adds to the sums of squares (r, r) of the resistive columns, R0's of each cell.

    Of a lag it is less by the step over twice the time constant, some per cent, and left in.
    """
    cells, count = soc.shape[1], len(knots)
    added = np.zeros((2 * cells * count,) * 2)
    for c, std in enumerate(np.broadcast_to(np.asarray(noise_ampere, float), (cells,))):
        at, shape = slice(2 * c * count, (2 * c + 1) * count), hats(soc[:, c], knots)
        added[at, at] = std**2 * shape.T @ shape
    return added


def _solve(matrix, voltage, knots, cells, noise):
    # Against voltage errors: bend of the OCV [V], size of deviations [1], bend of resistances [A].
    bend, size, wiggle = 1e-3, 1e-2, 1e-2
    ocv, deviation, resistance = knots
    slope = np.diff(np.eye(len(ocv)), axis=0) / np.diff(ocv)[:, None]
    increments = np.tril(np.ones((len(ocv), len(ocv))))
    blocks = [size * np.eye(cells * len(deviation)), bend * np.diff(slope, axis=0) @ increments]
    blocks += [wiggle * np.diff(np.eye(len(resistance)), 2, axis=0)] * (2 * cells)
    gram, column = matrix.T @ matrix, 0
    for block in blocks:
        columns = slice(column, column + block.shape[1])
        gram[columns, columns] += len(matrix) * block.T @ block
        column = columns.stop
    moment = matrix.T @ voltage
    gram = _without_noise(gram, noise)
    return solve(gram, moment, cells * len(deviation)), gram


def _without_noise(gram, noise):
    """Sums of squares less what noise adds, by no more than 95 % of what would leave none.

    Where noise is most of what a current moves by, all of it taken out could leave nothing that
    tells a resistance (Fuller's modification for small samples does likewise).
    """
    if not noise.any():
        return gram
    added = np.zeros(gram.shape)
    added[-len(noise) :, -len(noise) :] = noise
    try:
        root = np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:  # nothing tells the parameters apart: the solution refuses it
        return gram
    half = np.linalg.solve(root, np.linalg.solve(root, added).T)
    # 95 %: what is left stays positive definite.
    return gram - min(1.0, 0.95 / np.linalg.eigvalsh(half)[-1]) * added


def _cells(fit, parameters, knots, capacity):
    """PackCells of some parameters of a structure."""
    cells = len(capacity)
    deviation, increments, (r0, pair) = _of_cells(parameters, knots, cells)
    common = np.interp(np.linspace(0.0, 1.0, POINTS), knots[0], np.cumsum(increments))
    linear = slice(0, 0 if fit.scale_volt else 1)
    ohm, second = np.maximum(pair, 0.0)[:, None], np.full((cells, 1, POINTS), fit.tau_second)
    found = rc_cells(
        ocv_volt=np.maximum.accumulate(common + deviation, axis=1),
        r0_ohm=np.maximum(r0, 1e-4),  # what acts at once has to be above zero in a parallel group
        r_ohm=ohm[:, linear],
        tau_second=second[:, linear],
        capacity_ampere_hour=capacity,
    )
    if not fit.scale_volt:
        return found
    kinetic = {"kinetic_r_ohm": ohm, "kinetic_tau_second": second}
    kinetic |= {"kinetic_scale_volt": np.full(ohm.shape, fit.scale_volt)}
    tables = found.tables | {name: table[None] for name, table in kinetic.items()}
    return found._replace(members=("0RC+K",) * cells, tables=tables)


def group_models(test, steps, cells):
    """Models of all cells of a group from the longest charge in its own record.

    1. The stretch runs from the middle of the rest before the group's longest charge to the end of
    the rest after it; the branch sensors' offsets are what they read in the second half of the
    rest before. That rest is needed: on a slow charge nothing but the step from it tells the
    resistance that all cells have in common from the OCV. 2. `identify_branches` fits it. 3. What
    lies outside the stretch is left for scoring: each model says in `fitted` which part of the
    record it has seen.

    Parameters
    ----------
    test : MeasuredTest of the group, with branch_<k>_current_ampere.
    steps : dict of columns of stage `segment`.
    cells : names of the cells, in the order of the branches.

    Returns
    -------
    models : dict, cell → model of schema cellwright-model/2, kind "group".

    Raises
    ------
    Refusal : no branch currents, no charge between two rests, or as `identify_branches`.
    """
    facts, series = test
    current = _logged(branch_currents(series), cells)
    before, last = _charge_between_rests(steps)
    rest = slice(steps["first_row"][before], steps["last_row"][before] + 1)
    total = series["current_ampere"]
    # In its second half the currents between the cells have decayed.
    tail = slice(max(rest.stop - (rest.stop - rest.start) // 2, rest.start), rest.stop)
    limit = AT_REST_SHARE * np.abs(total).max()
    offset = rest_offset(current[tail], total[tail], rest_ampere=limit)
    rows = slice(tail.start, steps["last_row"][last] + 1)
    time = series["test_time_second"][rows]
    # ASSUME: What a branch sensor scatters by in that rest is its noise, white, at any load.
    noise = np.std(current[tail], axis=0)
    charged = current[rows] - offset
    # ASSUME: All cells of a group have the chamber's temperature, 25 °C where none is stated.
    celsius = stated_or_reference(facts.ambient_temperature_celsius)
    volt = series["voltage_volt"][rows]
    fit = identify_branches(time, charged, volt, noise_ampere=noise, celsius=celsius)
    fitted = {"test": facts.test, "from_second": float(time[0]), "to_second": float(time[-1])}
    note = (
        f"identified inside its group from the charge at {time[0]:.0f} to {time[-1]:.0f} s of "
        f"{facts.test} (fit {1e3 * fit.fit_rmse_volt:.1f} mV); the rest of the record scores it"
    )
    names = ("sensor_offset_ampere", "sensor_noise_ampere")
    seen = [
        fitted | dict(zip(names, map(float, pair), strict=True))
        for pair in zip(offset, noise, strict=True)
    ]
    return {
        cell: _model(cell, fit, branch, celsius, seen[branch], note)
        for branch, cell in enumerate(cells)
    }


def _logged(current, cells):
    if current is None or current.shape[1] < 2:
        raise Refusal("the record has no currents of two or more branches")
    if current.shape[1] != len(cells):
        counts = f"{current.shape[1]} branch currents for {len(cells)} cells"
        raise Refusal(f"found {counts}, wanted one of each to identify them")
    return current


def _charge_between_rests(steps):
    """Indices of the rests before and after the longest charge."""
    kind, charge = steps["kind"], steps["charge_ampere_hour"]
    rests = np.flatnonzero(kind == "rest")
    # Every step between the two rests has to charge: else its SoC would not run from 0 to 1.
    spans = [
        (charge[before + 1 : after].sum(), before, after)
        for before, after in pairwise(rests)
        if after > before + 1 and (steps["current_mean_ampere"][before + 1 : after] > 0).all()
    ]
    if not spans:
        raise Refusal("the record has no charge between two rests to identify its cells from")
    _, before, after = max(spans)
    return before, after


def _model(cell, fit, branch, celsius, fitted, note):
    cells, volt = fit.cells, fit.cells.tables["ocv_volt"][0, branch, 0]
    grid = np.linspace(0.0, 1.0, len(volt))
    ocv = {"ambient_temperature_celsius": celsius, "soc": grid.tolist()}
    ocv |= {"ocv_volt": volt.tolist(), "branches": "group"}
    condition = {"ambient_temperature_celsius": celsius} | _courses(fit.cells, branch, volt)
    condition |= {"fit_rmse_volt": fit.fit_rmse_volt, "tests": [fitted["test"]]}
    stds = fit.r0_std_ohm, fit.r_std_ohm, fit.steady_std_ohm, fit.ocv_std_volt
    r0_std, r_std, steady_std, ocv_std = (_at_knots(std[branch]) for std in stds)
    condition |= {"r0_std_ohm": r0_std, "steady_std_ohm": steady_std}
    condition |= {"ocv_shift_std_volt": ocv_std, "at_bound": []}
    (branch_of,) = condition["branches"]
    branch_of |= {"r_std_ohm": r_std, "tau_std_second": [None] * KNOTS}
    member, alike = cells.members[branch], [_courses(one, branch, volt) for one in fit.alike]
    return {
        "schema": SCHEMA,
        "cell": cell,
        "capacity_ampere_hour": float(cells.capacity_ampere_hour[branch]),
        "borrowed_from": None,
        "ocv": [ocv],
        "members": [{"model": member, "left_out_rmse_volt": None, "conditions": [condition]}],
        "chosen": member,
        "kind": "group",
        "fitted": fitted,
        "alike": [{"ambient_temperature_celsius": celsius} | one for one in alike],
        "notes": [note],
    }


def _courses(cells, branch, model_volt):
    """Condition of a model file for one branch of some cells: its courses over SoC.

    model_volt : (p,) OCV of the model [V], of which that of these cells is a shift.
    """
    tables = {name: table[0, branch] for name, table in cells.tables.items()}
    linear = len(tables["r_ohm"]) > 0
    names = {"r_ohm": "r_ohm", "tau_second": "tau_second"}
    if not linear:
        names = {name: f"kinetic_{name}" for name in (*names, "scale_volt")}
    pair = {name: _at_knots(tables[table][0]) for name, table in names.items()}
    return {
        "soc": np.linspace(0.0, 1.0, KNOTS).tolist(),
        "r0_ohm": _at_knots(tables["r0_ohm"][0]),
        "branches": [{"kind": "RC" if linear else "kinetic"} | pair],
        "ocv_shift_volt": _at_knots(tables["ocv_volt"][0] - model_volt),
        "ocv_scale": {"missing": 0.0, "stretch": 0.0},
        "activation_energy_joule_per_mole": 0.0,
    }


def _at_knots(table):
    """A course (p,) at the knots of the model file; None where it is not known."""
    course = np.interp(np.linspace(0.0, 1.0, KNOTS), np.linspace(0.0, 1.0, len(table)), table)
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in course]
