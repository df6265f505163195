"""Charge transfer that does not follow Ohm's law."""

import numpy as np

from cellwright.effects.effect import Effect, Parameter


def _kinetic(fields, stack, p):
    """Butler–Volmer with equal transfer coefficients: a share of R0 follows asinh(I/2I0)·2I0."""
    part = p["share_of_resistance"] * fields.ohmic
    size = p["per_exchange_current_per_ampere"] * fields.current / 2.0
    shrunk = np.divide(np.arcsinh(size), size, out=np.ones_like(size), where=np.abs(size) > 1e-9)
    return fields._replace(ohmic=fields.ohmic + part * (shrunk - 1.0))


EFFECTS = (
    Effect(
        id="charge_transfer_nonlinearity",
        sentence="charge transfer after Butler–Volmer: large currents cost less than in proportion",
        parameters=(
            Parameter(
                *("per_exchange_current_per_ampere", "1/A", 0.0, 0.0, 20.0),
                step=0.02,
                plausible=0.5,
                material=0.01,
            ),
            Parameter("share_of_resistance", "1", 0.7, 0.2, 1.0, step=0.05, shape=True),
        ),
        stage="overpotential",
        act=_kinetic,
        starts=(
            {"per_exchange_current_per_ampere": 0.15},
            {"per_exchange_current_per_ampere": 0.6},
            {"per_exchange_current_per_ampere": 2.5},
        ),
        needs=("rates",),
        shows="pulses of at least four sizes at one state of charge",
        consequence="resistance from small pulses overstates what large loads cost",
    ),
)
