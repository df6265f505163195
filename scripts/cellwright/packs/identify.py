"""Models of cells known only from inside a parallel group: from their branch currents.

All cells of a group see one voltage: V = f(z_c) + d_c(z_c) + R0_c(z_c)·I_c + u_c for every cell
c. With the charge of each branch counted, this is linear in the common OCV curve f (monotone), in
each cell's small deviation d_c from it, and in all resistances.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS
from cellwright.identification.cell import SCHEMA
from cellwright.numerics.lags import lag
from cellwright.numerics.linear import hats, solve
from cellwright.numerics.statistics import parameter_covariance, rms, standard_deviations
from cellwright.packs.cells import PackCells, rc_cells
from cellwright.packs.compare import passed_ampere_hour
from cellwright.records.conditions import AT_REST_SHARE, stated_or_reference
from cellwright.records.record import branch_currents
from cellwright.refusal import Refusal

KNOTS = 21  # of SoC, of a resistance in the model file


class GroupFit(NamedTuple):
    """Identified cells (every SoC is 0 at the first sample) and how well they fit.

    cells : PackCells. fit_rmse_volt : of all cells together [V].
    r0_std_ohm, r_std_ohm, ocv_std_volt : (cells, p) standard deviations of R0, of the RC pair's
    resistance and of each cell's deviation from the common OCV, for errors that are as correlated
    as the residual is.
    """

    cells: PackCells
    fit_rmse_volt: float
    r0_std_ohm: np.ndarray
    r_std_ohm: np.ndarray
    ocv_std_volt: np.ndarray


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
):
    """One-RC models of all cells of a group from one full slow charge of the group: GroupFit.

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
    steps = np.diff(test_time_second)
    noise = _noise(soc, knots_at[-1], noise_ampere)
    fits = []
    for tau in tau_second:
        matrix = _design(steps, branch_current_ampere, soc, knots_at, tau)
        parameters, gram = _solve(matrix, voltage_volt, knots_at, soc.shape[1], noise)
        error = matrix @ parameters - np.tile(voltage_volt, soc.shape[1])
        fits.append((rms(error), tau, parameters, gram, error, matrix))
    rmse, tau, parameters, *known = min(fits, key=lambda entry: entry[0])
    cells = _cells(parameters, knots_at, capacity, tau)
    return GroupFit(cells, rmse, *_deviations(*known, knots_at, len(capacity)))


def _deviations(gram, error, matrix, knots, cells):
    """Standard deviations (cells, POINTS) of R0, the pair's resistance and the OCV's deviation."""
    power = error @ error
    cover = parameter_covariance(gram, power, len(error), sensitivity=matrix.T, residual=error)
    deviation, _, resistance = _of_cells(standard_deviations(cover), knots, cells)
    return *resistance, deviation


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


def _design(steps, current, soc, knots, tau):
    """Columns: deviations of all cells, OCV start and increments, then (R0, R1) of each cell."""
    (at_ocv, at_deviation, at_resistance), cells, rows = knots, soc.shape[1], []
    for c in range(cells):
        driven = hats(soc[:, c], at_resistance) * current[:, c : c + 1]
        resistive = np.hstack([driven, lag(steps, tau, driven, hold="first_order")])
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
    moment = matrix.T @ np.tile(voltage, cells)
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


def _cells(parameters, knots, capacity, tau):
    cells = len(capacity)
    deviation, increments, (r0, pair) = _of_cells(parameters, knots, cells)
    common = np.interp(np.linspace(0.0, 1.0, POINTS), knots[0], np.cumsum(increments))
    return rc_cells(
        ocv_volt=np.maximum.accumulate(common + deviation, axis=1),
        r0_ohm=np.maximum(r0, 1e-4),  # what acts at once has to be above zero in a parallel group
        r_ohm=pair[:, None],
        tau_second=np.full((cells, 1, POINTS), tau),
        capacity_ampere_hour=capacity,
    )


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
    fit = identify_branches(time, charged, series["voltage_volt"][rows], noise_ampere=noise)
    # ASSUME: All cells of a group have the chamber's temperature, 25 °C where none is stated.
    fitted = {"test": facts.test, "from_second": float(time[0]), "to_second": float(time[-1])}
    celsius = stated_or_reference(facts.ambient_temperature_celsius)
    note = (
        f"identified inside its group from the charge at {time[0]:.0f} to {time[-1]:.0f} s of "
        f"{facts.test} (fit {1e3 * fit.fit_rmse_volt:.1f} mV); the rest of the record scores it"
    )
    seen = [fitted | {"sensor_offset_ampere": float(ampere)} for ampere in offset]
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
    condition = {"ambient_temperature_celsius": celsius} | _courses(fit, branch, grid)
    condition |= {"fit_rmse_volt": fit.fit_rmse_volt, "tests": [fitted["test"]]}
    return {
        "schema": SCHEMA,
        "cell": cell,
        "capacity_ampere_hour": float(cells.capacity_ampere_hour[branch]),
        "borrowed_from": None,
        "ocv": [ocv],
        "members": [{"model": "1RC", "left_out_rmse_volt": None, "conditions": [condition]}],
        "chosen": "1RC",
        "kind": "group",
        "fitted": fitted,
        "notes": [note],
    }


def _courses(fit, branch, grid):
    """Condition of a model file for one branch of the group: its courses over SoC."""
    knots = np.linspace(0.0, 1.0, KNOTS)
    r0, ohm, second = (fit.cells.tables[n][0, branch] for n in ("r0_ohm", "r_ohm", "tau_second"))

    def at_knots(table):
        return [None if np.isnan(v) else float(v) for v in np.interp(knots, grid, table)]

    return {
        "soc": knots.tolist(),
        "r0_ohm": at_knots(r0[0]),
        "r0_std_ohm": at_knots(fit.r0_std_ohm[branch]),
        "branches": [
            {"kind": "RC", "r_ohm": at_knots(r), "r_std_ohm": at_knots(fit.r_std_ohm[branch])}
            | {"tau_second": at_knots(tau), "tau_std_second": [None] * KNOTS}
            for r, tau in zip(ohm, second, strict=True)
        ],
        "ocv_shift_volt": [0.0] * KNOTS,
        "ocv_shift_std_volt": at_knots(fit.ocv_std_volt[branch]),
        "ocv_scale": {"missing": 0.0, "stretch": 0.0},
        "activation_energy_joule_per_mole": 0.0,
        "at_bound": [],
    }
