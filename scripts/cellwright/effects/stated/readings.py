"""Errors of reading in one test alone: of its voltage, its current, or its clock.

An effect of the library is in every test. A channel that was changed, or a lead that was moved, is
wrong in one: no effect follows what that one shows and tests like it do not, and a search that must
follow it bends the rest. Such an error is estimated, told, and taken off before the search is
repeated.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.judge import FAR_STDS, unsure_of
from cellwright.effects.library.readings import READINGS
from cellwright.effects.library.vocabulary import SLOW_TEST
from cellwright.effects.proof import block_sums, blocks_of, evenly, excess_volt
from cellwright.effects.records import KELVIN
from cellwright.numerics.least_squares import inverse
from cellwright.numerics.statistics import rms

LOAD_RATIO = 1.5  # of the root mean square currents of two tests that are alike
HALF = 0.5  # of an error of reading: a test that shows less has not got it
STEPS = 3  # of the size of an error, the model refitted with it


class Misread(NamedTuple):
    """An error of reading of one test.

    test : its name. name : of the kind of error, in `library.readings.READINGS`. value : what is
    read less what is true, of a gain relative. std : of it. unit : of both.
    """

    test: str
    name: str
    value: float
    std: float
    unit: str


ALIKE = 1.01  # falls of chi-square up to which of two sizes tried the first is taken
SHAPES = tuple((name, size) for name, one in READINGS.items() for size in one.sizes)


def tolerances(case):
    """Standard deviation of each error of reading as the sheets of the instruments state it."""
    about = case.tolerance, case.cell.capacity_ampere_hour
    return {name: reading.tolerance(*about) for name, reading in READINGS.items()}


def misread(case, state, filters, floor, refit):
    """The error of reading that explains most of what a model leaves of one test; None: none.

    It is told where its size is beyond three deviations, those of the tolerances and its own; where
    most tests of its kind, temperature and load show less than half of it and are followed twice as
    well (without such a test it could be an effect of that temperature or load); and where the
    model, refitted, leaves what anyone would accept beyond the floor, evenly over the test's parts,
    and takes off more than that.

    Parameters
    ----------
    case : case.Case. state : candidates.State of the model. filters : case.Filters. floor :
    proof.Floor. refit : function (case, state, filters) → Solution of the same model.

    Returns
    -------
    misread : Misread, or None.
    """
    estimates = _estimates(case, state, filters, floor)
    ways = {test: _ways(case, estimates, test) for test in estimates}
    for test in sorted(ways, key=lambda one: -max(ways[one].values(), default=0.0)):
        tried = [
            _refined(case, state, filters, floor, refit, estimates[test].errors[name], test, name)
            for name in ways[test]
        ]
        found = [
            (rms(now.residual), one)
            for one, now in tried
            if _sure(case, one.name, one) and _explained(case, estimates[test], now)
        ]
        if found:
            return min(found, key=lambda pair: pair[0])[1]
    return None


def _ways(case, estimates, test):
    """Errors that a test seems to have and most tests like it have not: fall of chi-square by name.

    None of a test of which the model leaves what anyone would accept. How sure an error is, only
    the model refitted with it tells: without it, it is misfit itself.
    """
    mine, known = estimates[test], tolerances(case)
    if mine.excess_volt < case.gates.unknown_volt:
        return {}
    return {
        name: error.fall
        for name, error in mine.errors.items()
        if abs(error.value) > FAR_STDS * known[name] and _alone(estimates, test, name)
    }


def _refined(case, state, filters, floor, refit, error, test, name):
    """An error of reading of a test with which the model is refitted until it stays.

    Returns
    -------
    misread : Misread. now : _Estimate of the test once it is taken off.
    """
    value = 0.0
    for _ in range(STEPS):
        value += error.value
        one = Misread(test, name, value, error.std, READINGS[name].unit)
        read = _taken_off(case, one)
        again = read.state(state.effects, refit(read, state, filters), filters)
        now = _estimates(read, again, filters, floor)[test]
        error = now.errors[name]
        if abs(error.value) < error.std:
            break
    return one._replace(std=error.std), now


def _sure(case, name, error):
    return abs(error.value) > FAR_STDS * max(tolerances(case)[name], error.std)


def _estimates(case, state, filters, floor):
    """_Estimate of each test but the slow one, by its name."""
    sides = _fitted_side(case, state, filters, floor), _judging_side(case, state, filters, floor)
    estimates = {test: _of_test(sides, test) for side in sides for test in side.stack.tests}
    return {
        test: one for test, one in estimates.items() if one.kind != SLOW_TEST and len(one.residual)
    }


class _Side(NamedTuple):
    """One side of a case: what a model leaves of it, and what errors of reading would leave.

    residual, whitened : (n,) [V], [1]. inflation, floor_volt : (f,) of each record. block : (n,),
    see `proof.blocks_of`. columns : (n, e) what each of `SHAPES` adds to the residual, in all
    records at once [V]. white : the same whitened. nuisances, white_nuisances : (n, p) of what
    follows it. covariances : f of (p, p), of what follows in each record.
    """

    stack: object
    residual: np.ndarray
    whitened: np.ndarray
    inflation: np.ndarray
    floor_volt: np.ndarray
    block: np.ndarray
    columns: np.ndarray
    white: np.ndarray
    nuisances: np.ndarray
    white_nuisances: np.ndarray
    covariances: tuple


class _Error(NamedTuple):
    """Estimate of an error: value, std, by how much chi-square falls, and number of its shape."""

    value: float
    std: float
    fall: float
    shape: int


class _Estimate(NamedTuple):
    """Errors of a test by name, and what the model leaves of its rows.

    kind, celsius : of the test. ampere : root mean square of its current. errors : dict of _Error.
    shares : (e,) of each of `SHAPES`. residual : (r,) of rows that count [V]. block : (r,) numbers.
    floor_volt : of the test.
    """

    kind: str
    celsius: float
    ampere: float
    errors: dict
    shares: np.ndarray
    residual: np.ndarray
    block: np.ndarray
    floor_volt: float

    @property
    def excess_volt(self):
        """Error beyond the floor [V]."""
        return excess_volt(rms(self.residual), self.floor_volt)


def _fitted_side(case, state, filters, floor):
    stack, solution = case.fit, state.solution.inside
    about = solution.residual, solution.whitened, case.inflation(state)["fit"]
    floors = np.full(len(stack.first), floor.fit_volt)
    columns = _columns(case, stack, solution.values, state.effects, solution.prediction)
    covariance = inverse(solution.precision)
    return _Side(
        *(stack, *about, floors, _blocks(case, stack, solution.values, state, filters.fit_rows)),
        *(columns, filters.fit.apply(columns), solution.columns, solution.white),
        (covariance,) * len(floors),
    )


def _judging_side(case, state, filters, floor):
    stack, values, whitening = case.validation, state.values, filters.validation
    about = state.validation, state.validation_white, case.inflation(state)["validation"]
    floors = [floor.by_test.get(test, floor.validation_volt) for test in stack.tests]
    volt = base.voltage(case.cell, stack, values, state.effects)
    columns = _columns(case, stack, values, state.effects, volt)
    nuisances, stds = unsure_of(case.cell, stack, values, state.effects, case.tolerance, volt)
    white = whitening.apply(nuisances)
    covariances = []
    for k, test in enumerate(stack.tests):
        mine = white[stack.file == k]
        known = np.diag(stds[k] ** -2.0)
        # One start of a record of which another part was fitted: that part follows.
        shared = test in case.fit.tests
        covariances.append(np.zeros_like(known) if shared else inverse(mine.T @ mine + known))
    rows = filters.validation_rows
    return _Side(
        *(stack, *about, np.array(floors), _blocks(case, stack, values, state, rows)),
        *(columns, whitening.apply(columns), nuisances, white, tuple(covariances)),
    )


def _blocks(case, stack, values, state, rows):
    soc = base.fields_of(case.cell, stack, values, state.effects).soc
    return blocks_of(stack, soc, rows & stack.used)


def _columns(case, stack, values, effects, volt):
    """What each of `SHAPES` adds to the residual, in all records at once (n, e) [V]."""
    columns = []
    for name, size in SHAPES:
        read = _read_anew(case, stack, name, np.full(len(stack.first), size))
        without = read.voltage_volt - base.voltage(case.cell, read, values, effects)
        columns.append(stack.voltage_volt - volt - without)
    return np.stack(columns, axis=1)


def _of_test(sides, test):
    """_Estimate of the errors of a test, by its parts on either side."""
    parts = [(s, s.stack.tests.index(test)) for s in sides if test in s.stack.tests]
    information, score = np.zeros(len(SHAPES)), np.zeros(len(SHAPES))
    residual, block, celsius, ampere = [], [], [], []
    for number, (side, k) in enumerate(parts):
        rows = side.stack.file == k
        white, nuisances = side.white[rows], side.white_nuisances[rows]
        shared = nuisances.T @ white
        followed = np.sum(shared * (side.covariances[k] @ shared), axis=0)
        information += (np.sum(white**2, axis=0) - followed) / side.inflation[k]
        score += white.T @ side.whitened[rows] / side.inflation[k]
        counted = rows & (side.block >= 0)
        residual.append(side.residual[counted])
        block.append(side.block[counted] + number * (side.block.max() + 1))
        celsius.append(side.stack.celsius[rows])
        ampere.append(side.stack.current_ampere[rows])
    side, k = parts[0]
    return _Estimate(
        side.stack.kinds[k],
        float(np.concatenate(celsius).mean()),
        rms(np.concatenate(ampere)),
        *_errors(information, score),
        *map(np.concatenate, (residual, block)),
        max(side.floor_volt[k] for side, k in parts),
    )


def _errors(information, score):
    """Errors of a test by name, of those of its shapes the one by which chi-square falls most."""
    share, errors = score / np.maximum(information, 1e-300), {}
    columns = share.tolist(), information.tolist(), (share * score).tolist()
    for shape, (part, much, fall) in enumerate(zip(*columns, strict=True)):
        name, size = SHAPES[shape]
        # What is not linear is so about its own size only.
        near = READINGS[name].linear or HALF <= part <= 1.0 / HALF
        error = _Error(part * size, abs(size) * max(much, 1e-300) ** -0.5, fall, shape)
        if name not in errors or (near and fall > ALIKE * errors[name].fall):
            errors[name] = error
    return errors, share


def _alone(estimates, test, name):
    """Whether most tests like a test show less than half of its error, and are followed well.

    Where the model fails them by as much, a test is no exception, whatever its error looks like.
    """
    mine = estimates[test]
    shape = mine.errors[name].shape
    like = [one for other, one in estimates.items() if other != test and _like(one, mine)]
    without = sum(
        one.shares[shape] / mine.shares[shape] < HALF and one.excess_volt < HALF * mine.excess_volt
        for one in like
    )
    return bool(without > len(like) / 2)


def _like(one, other):
    """Whether two tests are of one kind, and of temperatures and loads that differ little."""
    loads = sorted([one.ampere, other.ampere])
    near = abs(one.celsius - other.celsius) <= KELVIN
    return one.kind == other.kind and near and loads[1] <= LOAD_RATIO * loads[0]


def _explained(case, before, after):
    """Whether what was left of a test is gone to what anyone would accept, evenly over its parts.

    An error of reading by itself leaves nothing. What leaves more is something else, in part alike:
    a cell that ages within the campaign seems to have another current in its last tests.
    """
    taken = excess_volt(before.excess_volt, after.excess_volt)
    if not after.excess_volt <= case.gates.unknown_volt <= taken:
        return False
    about = before.residual, after.residual, before.block, np.zeros(len(before.block), int)
    return evenly(block_sums(*about), material_volt=case.gates.material_volt).holds


def corrected(case, found):
    """The case with an error of reading taken off its test, under either hold of the current.

    Parameters
    ----------
    case : case.Case. found : Misread.
    """
    before = sum(m.value for m in case.misread if (m.test, m.name) == (found.test, found.name))
    others = [m for m in case.misread if (m.test, m.name) != (found.test, found.name)]
    told = (*others, found._replace(value=before + found.value))
    other = case.otherwise
    if other is not None:
        other = _taken_off(other, found)._replace(misread=told)
    return _taken_off(case, found)._replace(otherwise=other, misread=told)


def _taken_off(case, found):
    sides = {}
    for role in ("fit", "validation"):
        stack = getattr(case, role)
        size = np.array([found.value if test == found.test else 0.0 for test in stack.tests])
        sides[role] = _read_anew(case, stack, found.name, size) if size.any() else stack
    return case._replace(**sides)


def _read_anew(case, stack, name, size):
    """A stack without an error of reading of so much (f,) in each record."""
    return READINGS[name].taken_off(stack, size, case.cell.capacity_ampere_hour)
