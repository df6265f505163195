"""A PyBaMM model marched through a protocol by implicit steps of chosen lengths.

An adaptive solver takes twenty steps a second on a drive, since the current bends at every second.
Here a drive goes by the second and a rest by steps that grow, with the two-stage method of
Alexander (SIAM J. Numer. Anal. 14, 1977, 1006): second order, L-stable, stiffly accurate, so that
it holds for the algebraic equations, too. The cell's current is one of the unknowns: given by the
cycler, or such that the voltage is held.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import casadi
import numpy as np
import pybamm
from scipy.interpolate import PchipInterpolator
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import Chamber, temperature_at
from virtual_lab.physics import Cell, inside, porous
from virtual_lab.protocols import Step

CURRENT, AMBIENT = "Current function [A]", "Ambient temperature [K]"
INITIAL = (
    "Initial temperature [K]",
    "Initial concentration in negative electrode [mol.m-3]",
    "Initial concentration in positive electrode [mol.m-3]",
)
SIDES = ("negative", "positive")
BRANCH = "Initial hysteresis state in positive electrode"
REFERENCE_CELSIUS = 25.0
GAMMA = 1 - 1 / np.sqrt(2)
FIRST_SECOND, GROWTH, LONGEST_SECOND = 1e-3, 1.3, (30.0, 120.0)
LONGEST_SHARE = 1 / 400  # of a step's duration
DRIVE_SECOND = 1.0
SHORTEST_SECOND = 0.01
INSTANT_SECOND = 1e-6  # in which the algebraic unknowns follow a jump of the current
NEWTON_TOLERANCE, LEAST_SIZE = 1e-5, 1e-2  # change relative to the size of each unknown
MOST_ITERATIONS, SLOW_ITERATIONS, MOST_ATTEMPTS = 6, 5, 5
SAME_LENGTH = 1.001
VOLT_TOLERANCE, AMPERE_TOLERANCE = 1e-5, 1e-5
MOST_TRIALS = 30


class Equations(NamedTuple):
    """A cell's equations M y' = f(y): states of PyBaMM's model, and last the current [A].

    That is positive on discharge. `rate(y, kelvin, ohm, wanted, held)` gives f, whose last row is
    the current less the wanted one, or with `held` 1 the voltage less the wanted one; `ohm` is a
    resistance in series. `matrix(y, kelvin, ohm, wanted, held, weight)` gives M less the weighted
    derivative of f by y, as values of a sparse matrix with `rows` and `starts`. `shown(y, kelvin,
    ohm)` gives voltage [V] and the sensor's temperature [°C]. `scale`: sizes of the unknowns.
    """

    rate: Callable[..., np.ndarray]
    matrix: Callable[..., np.ndarray]
    rows: np.ndarray
    starts: np.ndarray
    shown: Callable[..., np.ndarray]
    mass: np.ndarray
    begin: np.ndarray
    scale: np.ndarray


class _Buffered:
    """A CasADi function that writes its one dense or sparse result into a fixed array."""

    def __init__(self, function):
        self._arrays = [np.zeros(function.nnz_in(k)) for k in range(function.n_in())]
        self._result = np.zeros(function.nnz_out(0))
        self._buffer, self._run = function.buffer()
        for k, array in enumerate(self._arrays):
            self._buffer.set_arg(k, memoryview(array))
        self._buffer.set_res(0, memoryview(self._result))

    def __call__(self, *values) -> np.ndarray:
        for array, value in zip(self._arrays, values, strict=True):
            array[:] = value
        self._run()
        return self._result.copy()


def equations(cell: Cell, *, celsius: float, initial_soc: float) -> Equations:
    """Equations of a cell, rested at a state of charge [1] and a temperature [°C]."""
    system, initial = _built(cell)
    ends, most = _limits(cell)
    soc = initial_soc * porous.full_charge_ampere_hour(cell) / ends["Q"]
    x, y = (ends[f"{k}_0"] + soc * (ends[f"{k}_100"] - ends[f"{k}_0"]) for k in "xy")
    kelvin = celsius + porous.ZERO_CELSIUS_KELVIN
    state = dict(zip(INITIAL, (kelvin, x * most[0], y * most[1]), strict=True))
    if porous.has_hysteresis(cell):
        state[BRANCH] = -1.0 if initial_soc < 1 else 1.0
    begin = initial.evaluate(inputs=_at_rest(celsius) | state)
    # PyBaMM counts potentials from those of the initial state.
    fixed = list(state.values())
    return system._replace(
        rate=partial(system.rate, fixed),
        matrix=partial(system.matrix, fixed),
        shown=partial(system.shown, fixed),
        begin=np.append(np.ravel(begin), 0.0),
    )


@lru_cache(maxsize=16)
def _limits(cell):
    """Lithiation at both ends of the window, and largest concentrations [mol/m³]."""
    values = porous.fresh_parameters(cell.chemistry, cell.rating)
    most = [values[f"Maximum concentration in {side} electrode [mol.m-3]"] for side in SIDES]
    return porous.stoichiometry(cell), most


def _at_rest(celsius):
    return {CURRENT: 0.0, AMBIENT: celsius + porous.ZERO_CELSIUS_KELVIN}


@lru_cache(maxsize=16)
def _built(cell):
    """Equations of a cell in any state, and PyBaMM's expression for the state it begins in."""
    values = porous.parameters(cell, ambient_celsius=REFERENCE_CELSIUS)
    initial = [*INITIAL, *([BRANCH] if porous.has_hysteresis(cell) else [])]
    at_rest = _at_rest(REFERENCE_CELSIUS) | {name: values[name] for name in initial}
    values.update(dict.fromkeys(at_rest, "[input]"))
    model = porous.model(cell)
    simulation = pybamm.Simulation(model, parameter_values=values, **porous.mesh(model, cell))
    simulation.build(inputs=at_rest)
    built = simulation.built_model
    mass = np.concatenate([np.ones(built.len_rhs), np.zeros(built.len_alg + 1)])
    sensor = inside.sensor_kelvin(cell.inside)
    rate, matrix, shown = _functions(built, initial, mass, sensor)
    starts, rows = matrix.sparsity_out(0).get_ccs()
    expression = built.concatenated_initial_conditions
    begin = np.ravel(expression.evaluate(inputs=at_rest))
    system = Equations(
        _Buffered(rate),
        _Buffered(matrix),
        np.array(rows),
        np.array(starts),
        _Buffered(shown),
        mass,
        np.append(begin, 0.0),
        np.append(np.maximum(np.abs(begin), LEAST_SIZE), 1.0),
    )
    return system, expression


def _functions(built, initial, mass, sensor):
    """CasADi functions rate, matrix and shown; their first argument holds the initial state."""
    names = ("current", "kelvin", "ohm", "wanted", "held")
    current, kelvin, ohm, wanted, held = (casadi.MX.sym(name) for name in names)
    state = casadi.MX.sym("state", built.len_rhs + built.len_alg)
    fixed = {name: casadi.MX.sym(name) for name in initial}

    def symbolic(expression):
        inputs = {CURRENT: current, AMBIENT: kelvin} | fixed
        return expression.to_casadi(casadi.MX(0), state, inputs=inputs)

    volt = symbolic(built.get_processed_variable("Voltage [V]")) - ohm * current
    celsius = symbolic(built.get_processed_variable(sensor)) - porous.ZERO_CELSIUS_KELVIN
    parts = [symbolic(built.concatenated_rhs)]
    parts += [symbolic(built.concatenated_algebraic)] if built.len_alg else []
    rate = casadi.vertcat(*parts, casadi.if_else(held > 0.5, volt, current) - wanted)
    unknowns = casadi.vertcat(state, current)
    given = [casadi.vertcat(*fixed.values()), unknowns, kelvin, ohm, wanted, held]
    weight = casadi.MX.sym("weight", len(mass))
    matrix = casadi.diag(casadi.DM(mass)) - casadi.mtimes(
        casadi.diag(weight), casadi.jacobian(rate, unknowns)
    )
    functions = [
        casadi.Function("rate", given, [casadi.densify(rate)]),
        casadi.Function("matrix", [*given, weight], [matrix]),
        casadi.Function("shown", given[:4], [casadi.vertcat(volt, celsius)]),
    ]
    return [one.expand() for one in functions]


class _Place(NamedTuple):
    """Unknowns y at a time [s] of the test, and what is shown there: voltage [V], sensor [°C].

    `slope`: change of the unknowns per second, from which the next ones are guessed. `between`:
    time and unknowns of the stage on the way here.
    """

    second: float
    y: np.ndarray
    volt: float
    celsius: float
    slope: np.ndarray | float = 0.0
    between: tuple[float, np.ndarray] | None = None


class _Load(NamedTuple):
    """What the cycler asks for: `wanted(second)`, a current [A] on discharge or a voltage [V]."""

    wanted: Callable[[float], float]
    held: float


class _Marcher:
    """Takes steps of a cell's equations; keeps the last factors of the matrix while they serve."""

    def __init__(self, system: Equations, chamber: Chamber, series: tuple):
        self.system, self._chamber, self._series = system, chamber, series
        self._differential = system.mass > 0
        self._factors, self._of = None, (0.0, -1.0)

    def around(self, second: float) -> tuple[float, float]:
        """Temperature around the cell [K] and resistance in series with it [ohm]."""
        ohm = np.interp(second, *self._series) if self._series else 0.0
        return float(temperature_at(self._chamber, second)) + porous.ZERO_CELSIUS_KELVIN, ohm

    def place(self, second: float, y: np.ndarray) -> _Place:
        """The unknowns with what is shown of them."""
        return _Place(second, y, *self.system.shown(y, *self.around(second)))

    def step(self, place: _Place, length: float, load: _Load) -> _Place:
        """The place after a step of a length [s]."""
        early, end = place.second + GAMMA * length, place.second + length
        guess = place.y + GAMMA * length * place.slope
        middle = self._stage(place.y, guess, early, length, load)
        slope = (middle - place.y) / (GAMMA * length)
        base = place.y + (1 - GAMMA) * length * slope
        y = self._stage(base, place.y + length * slope, end, length, load)
        slope = (y - middle) / ((1 - GAMMA) * length)
        return self.place(end, y)._replace(slope=slope, between=(early, middle))

    def _stage(self, base, guess, second, length, load):
        """Solve M (y − base) = γ h f(y) by Newton's method with factors that are kept."""
        given = (*self.around(second), load.wanted(second), load.held)
        ratio = max(length, self._of[0]) / max(min(length, self._of[0]), 1e-12)
        if ratio > SAME_LENGTH or self._of[1] != load.held:
            self._factor(guess, length, given)
        y = guess
        for _ in range(MOST_ATTEMPTS):
            y, iterations, solved = self._newton(base, y, length, given)
            if not np.isfinite(y).all():
                break
            if iterations >= SLOW_ITERATIONS:
                self._factor(y, length, given)
            if solved:
                return y
        self._of = (0.0, -1.0)
        raise RuntimeError(f"no solution at {second:.3f} s in a step of {length:g} s")

    def _newton(self, base, y, length, given):
        """Iterate, number of iterations, and whether it is the solution."""
        weight = np.where(self._differential, GAMMA * length, 1.0)
        for iteration in range(1, MOST_ITERATIONS + 1):
            residual = weight * self.system.rate(y, *given) - self.system.mass * (y - base)
            change = self._factors.solve(residual)
            y = y + change
            if np.max(np.abs(change) / self.system.scale) < NEWTON_TOLERANCE:
                return y, iteration, True
        return y, MOST_ITERATIONS, False

    def _factor(self, y, length, given):
        system, size = self.system, len(self.system.mass)
        weight = np.where(self._differential, GAMMA * length, 1.0)
        values = system.matrix(y, *given, weight)
        self._factors = splu(csc_array((values, system.rows, system.starts), (size, size)))
        self._of = (length, given[-1])


def run(
    steps: list[Step],
    cell: Cell,
    *,
    chamber: Chamber,
    initial_soc: float = 1.0,
    series: tuple = (),
) -> list[Behaviour]:
    """Simulate a rested cell in a protocol.

    Parameters
    ----------
    steps : what the cycler is told to do.
    cell : its parameters.
    chamber : temperature around the cell; it begins at that of the first instant.
    initial_soc : state of charge at the start [1]; 1 is after a CCCV charge.
    series : times [s] from the start of the test and resistances [ohm] in series with the cell
        there, straight between; none if empty.

    Returns
    -------
    One behaviour per step.

    Raises
    ------
    RuntimeError : a step of the method has no solution.
    """
    celsius = float(temperature_at(chamber, 0.0))
    system = equations(cell, celsius=celsius, initial_soc=initial_soc)
    marcher = _Marcher(system, chamber, series)
    place = marcher.place(0.0, system.begin)
    full, soc, behaviours = porous.full_charge_ampere_hour(cell), initial_soc, []
    for step in steps:
        places = _taken(marcher, place, step)
        behaviour = _behaviour(places, step, soc, full)
        place, soc = places[-1]._replace(slope=0.0), float(behaviour.soc(behaviour.duration_second))
        behaviours.append(behaviour)
    return behaviours


def _taken(marcher, begin, step) -> list[_Place]:
    """Places of one step, from right after it began to its end."""
    load, passed = _load(step, begin.second), _passed(step)
    places = [marcher.step(begin, INSTANT_SECOND, load)._replace(second=begin.second, slope=0.0)]
    ahead = (begin.second + _grid(step)[:0:-1]).tolist()
    while ahead:
        before, length = places[-1], ahead[-1] - places[-1].second
        after = _tried(marcher, before, length, load)
        if after is None:
            ahead.append(before.second + length / 2)
            continue
        if passed(after) < 0:
            return [*places, _last(marcher, before, after, load, passed)]
        # A drive bends too much within a second for a straight line.
        places += [marcher.place(*after.between)] if step.kind == "profile" else []
        places.append(after)
        ahead.pop()
    return places


def _tried(marcher, before, length, load):
    """The place after a step; None where a shorter step must be tried.

    An emptied cell may have no voltage at the end of a step that passes its cut-off.
    """
    try:
        return marcher.step(before, length, load)
    except RuntimeError:
        if length < SHORTEST_SECOND:
            raise
        return None


def _load(step, begin) -> _Load:
    if step.kind == "hold":
        return _Load(lambda second: step.value, 1.0)
    if step.kind == "profile":
        time, ampere = step.value.T
        return _Load(lambda second: -float(np.interp(second - begin, time, ampere)), 0.0)
    return _Load(lambda second: -step.value, 0.0)


def _passed(step):
    """A function of a place that falls below zero where the step is to end."""
    if step.kind == "hold":
        least = step.until_ampere
        return lambda place: 1.0 if least is None else abs(place.y[-1]) - least
    limit = step.until_volt
    if limit is None:
        return lambda place: 1.0
    charging = step.kind == "current" and step.value > 0
    return lambda place: (limit - place.volt) if charging else (place.volt - limit)


def _last(marcher, before, after, load, passed):
    """Place between two at which a step ends, by false position (Illinois)."""
    low, high = before, after
    of_low, of_high = passed(low), passed(high)
    for _ in range(MOST_TRIALS):
        share = of_low / (of_low - of_high)
        second = low.second + share * (high.second - low.second)
        middle = marcher.step(before, second - before.second, load)
        of_middle = passed(middle)
        if abs(of_middle) < min(VOLT_TOLERANCE, AMPERE_TOLERANCE):
            break
        if of_middle > 0:
            low, of_low, of_high = middle, of_middle, of_high / 2
        else:
            high, of_high, of_low = middle, of_middle, of_low / 2
    return middle


def _grid(step) -> np.ndarray:
    """Times [s] within a step at which it is solved."""
    end = step.duration_second
    if step.kind == "profile":
        longest = DRIVE_SECOND
        regular = np.union1d(np.arange(longest, end, longest), step.value[1:, 0])
    else:
        longest = np.clip(LONGEST_SHARE * end, *LONGEST_SECOND)
        regular = np.arange(longest, end, longest)
    count = int(np.log(longest / FIRST_SECOND) / np.log(GROWTH)) + 1
    early = np.cumsum(FIRST_SECOND * GROWTH ** np.arange(count))
    # Steps grow by 1.3 up to where the longest step fits, and are even from there on.
    grown = early if step.kind != "profile" else early[early < longest]
    regular = np.concatenate([[0.0], grown, regular[regular > grown[-1]]])
    second = regular[np.diff(regular, prepend=-1.0) > FIRST_SECOND / 2]
    return np.append(second[second < end - FIRST_SECOND], end)


def _behaviour(places, step, initial_soc, full_ampere_hour) -> Behaviour:
    second = np.array([place.second for place in places]) - places[0].second
    ampere = -np.array([place.y[-1] for place in places])
    charge = np.cumsum(np.append(0.0, 0.5 * (ampere[1:] + ampere[:-1]) * np.diff(second))) / 3600
    straight = step.kind == "profile" or len(second) < 3

    def read(values):
        known = np.array(values)
        if straight:
            return partial(np.interp, xp=second, fp=known)
        curve = PchipInterpolator(second, known)
        return lambda at: curve(np.clip(at, 0.0, second[-1]))

    counted = read(charge)
    return Behaviour(
        duration_second=float(second[-1]),
        current=read(ampere),
        voltage=read([place.volt for place in places]),
        temperature=read([place.celsius for place in places]),
        charge=counted,
        soc=lambda at: initial_soc + counted(at) / full_ampere_hour,
    )
