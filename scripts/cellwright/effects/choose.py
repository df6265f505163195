"""Which trial is chosen, if any: significant, proven, large enough, and what is as good."""

import numpy as np

from cellwright.effects.problem import stds
from cellwright.effects.slow_gap import HYSTERESIS, shows_hysteresis
from cellwright.effects.structural import offset_or_leak, rest_current, with_partners

LOGGED = {"current_offset", "leakage"}  # told apart by the current logged at rest
SLOW = "slow_diffusion"
OUTDONE = 0.5  # of the best J: an explanation below it is not the one


def best_of(gates, first, before, trials, floor):
    """The best trial that passes the gates, and the ids of those as good."""
    if before.worst_volt <= max(gates.nothing_ratio * floor, gates.nothing_volt):
        return None, ()
    if before is not first and before.worst_volt <= gates.adequate_ratio * floor:
        return None, ()
    proven = [t for t in trials if significant(gates, before, t)]
    passed = [t for t in proven if matters(gates, first, before, t, floor)]
    # Where far better explanations are too small to matter, a worse one is none either.
    if not passed or passed[0].j < OUTDONE * proven[0].j:
        return None, ()
    best = passed[0]
    within = max(gates.tie_absolute, gates.tie_relative * best.j)
    near = [t.effect.id for t in passed[1:] if best.j - t.j <= within]
    return best, tuple(dict.fromkeys(name for name in near if name != best.effect.id))


def denied(case, trials):
    """Ids of trials that something measured beside the records speaks against.

    The current logged at rest tells an offset from a leak. A gap between the branches of the slow
    test that no resistance explains is hysteresis, which slow diffusion must not stand in for.
    """
    told = {t.effect.id: _told(case, t) for t in trials if t.effect.id in LOGGED}
    against = {name for name, word in told.items() if word not in (None, name)}
    slow = [t for t in trials if t.effect.id == SLOW and _in_place_of_hysteresis(case, t)]
    return against | {t.effect.id for t in slow}


def _in_place_of_hysteresis(case, trial):
    values = trial.state.solution.values
    own = sum(np.exp(values[name]) for name in ("log_r0", "log_r1", "log_r2"))
    there = HYSTERESIS & {effect.id for effect in trial.state.effects}
    return not there and shows_hysteresis(case.gap, own + values[f"{SLOW}.resistance_ohm"])


def with_ties(case, chosen, tied, against, library):
    """The ties of a choice with their structural partners, without those the log denies."""
    known = {effect.id: effect for effect in library}
    tied = with_partners(chosen.effect.id, tied, known, chosen.state.solution.values)
    if chosen.effect.id in LOGGED and _told(case, chosen) is not None:
        against = against | LOGGED
    return tuple(name for name in tied if name not in against)


def _told(case, trial):
    """Which of an offset and a leak the log at rest says it is; None where it cannot tell."""
    name = trial.effect.names[0]
    size, std = trial.state.solution.values[name], stds(trial.state.solution)[name]
    rest = rest_current(case.fit, capacity_ampere_hour=case.cell.capacity_ampere_hour)
    return offset_or_leak(rest, size_ampere=size, std_ampere=std)[0]


def significant(gates, before, trial):
    """Whether a trial is better than chance on the records fitted, and on those that judge."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    return (
        trial.delta_bic > gates.bic
        and trial.delta_validation > gates.validation_chi_square
        and now <= (1.0 - gates.validation_fall) * was
    )


def matters(gates, first, before, trial, floor):
    """Whether what it takes off the error is large enough, in itself and beside the first gap."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    whole = max(first.validation_rmse_volt**2 - floor**2, 1e-12)
    taken = was**2 - now**2
    return (
        trial.material and taken >= gates.material_volt**2 and taken / whole >= gates.material_share
    )
