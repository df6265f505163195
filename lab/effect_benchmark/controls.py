"""Control terms, tried as the search tries an effect: none of them should be named.

A random smooth function of state of charge, current and temperature, with as many parameters as
the effect that was named; the named effect, computed from a current whose blocks were put into
another order; and an extra RC pair, whether or not one is missing.
"""

import numpy as np

from cellwright.effects import base, search
from cellwright.effects.candidates import Trial, candidates, judged, scored
from cellwright.effects.candidates import tried as refitted
from cellwright.effects.judge import unfitted
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import Effect, Parameter
from cellwright.records.conditions import REFERENCE_CELSIUS

EXTRA_RC = "slow_diffusion"
WAVES = 8  # of which a random function is the sum
SMOOTH = np.array([0.3, 1.0, 20.0])  # over which it changes: SoC, C-rate, kelvin
BLOCK_ROWS = 50  # of the current that stay together


def extra_rc() -> Effect:
    """An extra RC pair."""
    return LIBRARY[EXTRA_RC]


def random_term(count: int, capacity_ampere_hour: float, random) -> Effect:
    """Smooth functions of SoC, C-rate and temperature, drawn; as many as `count`, each in volts.

    Source: sums of cosines, A. Rahimi, B. Recht, Adv. Neural Inf. Process. Syst. 20 (2007) 1177.
    """
    frequency = random.normal(size=(count, WAVES, 3)) / SMOOTH
    phase = random.uniform(0.0, 2.0 * np.pi, (count, WAVES))
    names = [f"size{k}" for k in range(count)]

    def act(fields, stack, p):
        rate = stack.current_ampere / capacity_ampere_hour
        where = np.stack([fields.soc, rate, stack.celsius - REFERENCE_CELSIUS])
        volt = fields.volt
        for name, turns, start in zip(names, frequency, phase, strict=True):
            wave = np.cos(turns @ where + start[:, None]).sum(axis=0)
            volt = volt + p[name] * np.sqrt(2.0 / WAVES) * wave
        return fields._replace(volt=volt)

    sizes = tuple(Parameter(name, "V", 0.0, -0.2, 0.2, 1e-3, 5e-3) for name in names)
    return Effect("control_random", "a random function", sizes, "reading", act)


def permuted(effect: Effect, cell, values: dict, seed: int) -> Effect:
    """An effect computed from the same current in another order.

    Parameters
    ----------
    effect : the one. cell : base.Cell. values : dict of the model without it. seed : of the order.
    """
    name = "control_permuted"

    def act(fields, stack, p):
        mixed = _mixed(stack, seed)
        starts = {f"soc0[{k}]": float(soc) for k, soc in enumerate(stack.soc_at_start)}
        full = values | starts | {f"{effect.id}.{k}": v for k, v in p.items()}
        without = base.voltage(cell, mixed, full)
        change = base.voltage(cell, mixed, full, (effect,)) - without
        return fields._replace(volt=fields.volt + change)

    return effect._replace(id=name, stage="reading", act=act)


def _mixed(stack, seed):
    """The stack with blocks of rows of current and direction in another order, record by record."""
    random, order = np.random.default_rng(seed), np.arange(len(stack.file))
    for k in range(len(stack.first)):
        rows = np.flatnonzero(stack.file == k)
        blocks = np.array_split(rows, max(len(rows) // BLOCK_ROWS, 1))
        order[rows] = np.concatenate([blocks[j] for j in random.permutation(len(blocks))])
    current = stack.current_ampere[order]
    held = np.concatenate([[0.0], current[:-1]]) * (1.0 - stack.fresh)
    rows = {"current_ampere": current, "held_ampere": held, "direction": stack.direction[order]}
    return stack._replace(**rows, responses={}, courses={})


def tried(case, first: search.Round, effect: Effect) -> Trial:
    """A term refitted and judged as an effect of the search, beside those that it tried.

    Parameters
    ----------
    case : search.Case. first : the first round of its search. effect : the term.
    """
    # Effects that nobody would act on may be in the model of the first round already.
    effects, free = first.before.effects, unfitted(case)[1]
    for there in effects:
        free = case.with_effect(free, there)
    filters, solution = first.filters, first.before.solution.inside
    residual = filters.fit.apply(solution.residual)

    def predict(values, one):
        return base.voltage(case.cell, case.fit, values, (*effects, one))

    lined_up = candidates(predict, solution.prediction, solution.values, [effect])
    whitened = filters.fit.apply(np.concatenate([c.columns for c in lined_up], axis=1))
    scores = scored(
        lined_up, whitened, residual, solution.white, solution.precision, solution.values
    )
    best = max(scores, key=lambda one: one.chi_square)
    trial = refitted(case, LIBRARY, free, first.before, best, filters)
    # Misfit is what the best model leaves, so that it is judged together with the others.
    together = judged(case, first.before, [*first.trials, trial], filters)
    return next(one for one in together if one.effect is best.candidate.effect)
