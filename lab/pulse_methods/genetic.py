"""Genetic algorithm of the thesis for the parameters of a circuit."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.lags import lag_weights
from cellwright.refusal import Refusal
from pulse_methods.pulse import load_of, names_of


class GeneticFit(NamedTuple):
    """Best individual of a genetic search.

    names, values : of the parameters, as in `pulse.CircuitFit`. mean_square_volt2 : cost (2.20).
    course : (generations + 1,) best cost after each. evaluations : simulations of the record.
    """

    names: tuple
    values: np.ndarray
    mean_square_volt2: float
    course: np.ndarray
    evaluations: int


def cost_function(record, *, hold, n_rc=2):
    """Mean squared voltage error (thesis 2.20) of many circuits at once.

    Parameters
    ----------
    record : (test_time_second, current_ampere, voltage_volt, ocv_volt) as for `pulse.fit_circuit`.
    hold, n_rc : as there.

    Returns
    -------
    cost : function (k, p) → (k,) [V²], of ln R0, ln R_j, ln tau_j of k circuits.
    """
    load = load_of(*record, hold)

    def cost(logs):
        values = np.exp(logs)
        r0, r, tau = values[:, 0], values[:, 1 : n_rc + 1], values[:, n_rc + 1 :]
        decay, before, after = lag_weights(load.step_second[:, None, None], tau, hold=hold)
        pushed = before * load.drive[:-1, None, None] + after * load.drive[1:, None, None]
        return _power(decay, pushed, r0, r, load.drive, load.target_volt) / len(load.drive)

    return cost


def _power(decay, pushed, r0, r, drive, target_volt):
    """Sum of squared errors (k,) [V²] of k circuits.

    Parameters
    ----------
    decay, pushed : (n - 1, k, m) what is left of each pair's current over a step [1], and what the
        load adds to it [A]. r0, r : (k,), (k, m) [ohm]. drive, target_volt : (n,) [A], [V].
    """
    state, power = np.zeros(r.shape), (target_volt[0] - r0 * drive[0]) ** 2
    for k, target in enumerate(target_volt[1:]):
        state = decay[k] * state + pushed[k]
        power += (target - r0 * drive[k + 1] - (r * state).sum(axis=1)) ** 2
    return power


def evolve_by_genes(
    record,
    bounds,
    *,
    hold,
    n_rc=2,
    generations=100,
    population=60,
    mutation=0.15,
    elite=2,
    seed=0,
):
    """Genetic algorithm of the thesis' kind: tournament selection, blend crossover, mutation.

    1. Individuals are drawn evenly over the logarithms of the parameters.
    2. Parents are the better of two drawn at random (selection).
    3. Each gene of a child lies on the line through its parents' genes, from a quarter before one
       to a quarter behind the other (crossover).
    4. Some genes are moved by a normal step that shrinks over the generations (mutation).
    5. The best individuals live on unchanged (elite).

    Parameters
    ----------
    record, hold, n_rc : as in `cost_function`.
    bounds : dict, name → (lower, upper), for every parameter, above zero.
    generations : 100 in the thesis. population : individuals. seed : of the draws.
    mutation : share of genes moved. elite : how many live on.

    Returns
    -------
    fit : GeneticFit.

    Source: thesis 2.3; it prints neither its operators nor its rates. Blend crossover: L. Eshelman,
    J. Schaffer, Foundations of Genetic Algorithms 2 (1993) 187.
    """
    names = names_of(n_rc)
    logs, cost = _logs(bounds, names), cost_function(record, hold=hold, n_rc=n_rc)
    rng, width = np.random.default_rng(seed), np.diff(logs, axis=1)[:, 0]
    people = rng.uniform(*logs.T, size=(population, len(names)))
    costs = cost(people)
    course = [costs.min()]
    for generation in range(generations):
        best = people[np.argsort(costs, kind="stable")[:elite]]
        children = _children(rng, people, costs, population - elite)
        step = 0.1 * width * (1.0 - generation / generations) + 1e-4 * width
        mutated = rng.random(children.shape) < mutation
        children = children + mutated * step * rng.normal(size=children.shape)
        people = np.vstack([best, np.clip(children, *logs.T)])
        elite_costs = np.sort(costs, kind="stable")[:elite]
        costs = np.concatenate([elite_costs, cost(people[elite:])])
        course.append(costs.min())
    values = np.exp(people[np.argmin(costs)])
    evaluations = population + generations * (population - elite)
    return GeneticFit(names, values, float(costs.min()), np.array(course), evaluations)


def _children(rng, people, costs, count):
    rivals = rng.integers(0, len(people), size=(2, 2, count))
    winners = np.where(costs[rivals[0]] <= costs[rivals[1]], rivals[0], rivals[1])
    first, second = people[winners]
    share = rng.uniform(-0.25, 1.25, size=first.shape)
    return first + share * (second - first)


def _logs(bounds, names):
    missing = [name for name in names if name not in bounds]
    if missing:
        raise Refusal(f"the genetic algorithm needs bounds; none for {', '.join(missing)}")
    pairs = np.array([bounds[name] for name in names], float)
    if not ((pairs[:, 0] > 0) & (pairs[:, 1] > pairs[:, 0])).all():
        raise Refusal("bounds of the genetic algorithm must ascend and lie above zero")
    return np.log(pairs)
