"""Effects that depend on which way the last charge went."""

import numpy as np

from cellwright.effects.base import lag_fresh
from cellwright.effects.effect import Effect, Parameter


def _instant(fields, stack, p):
    return fields._replace(volt=fields.volt + p["amplitude_volt"] * stack.direction)


def _one_state(fields, stack, p):
    """dh = −g·|dSoC|·(h − s), s the sign of the current (thesis 2.16; Plett 2015, 2.65)."""
    passed = np.abs(fields.moved) / fields.capacity
    sign = np.append(np.sign(fields.held[1:]), 0.0)
    kept = np.zeros(len(sign))
    constant = 1.0 / p["rate_per_soc"]
    state = lag_fresh(passed, stack.fresh, kept, sign, constant, stack.direction)
    return fields._replace(volt=fields.volt + p["amplitude_volt"] * state)


EFFECTS = (
    Effect(
        id="hysteresis_instant",
        sentence="a voltage that changes its sign with the direction of the last load",
        parameters=(
            Parameter(
                *("amplitude_volt", "V", 0.0, 0.0, 0.1),
                step=1e-3,
                plausible=0.02,
                material=5e-4,
            ),
        ),
        stage="overpotential",
        act=_instant,
        needs=("both_directions",),
        shows="loads of both directions, each followed by a rest",
        consequence="the voltage at rest tells the state of charge only with the last direction",
    ),
    Effect(
        id="hysteresis_one_state",
        sentence="hysteresis: a voltage that follows the direction of the charge that passed",
        parameters=(
            Parameter(
                *("amplitude_volt", "V", 0.0, 0.0, 0.2),
                step=1e-3,
                plausible=0.02,
                material=5e-4,
            ),
            Parameter("rate_per_soc", "1", 20.0, 2.0, 200.0, step=2.0, shape=True),
        ),
        stage="overpotential",
        act=_one_state,
        starts=tuple({"rate_per_soc": rate} for rate in (4.0, 12.0, 40.0)),
        needs=("both_directions",),
        shows="a slow discharge and charge (C/20) with turns in between",
        consequence="the voltage at rest depends on the way there; a filter without it is biased",
    ),
)
