"""Effects of the ohmic resistance and of the polarisation."""

import numpy as np

from cellwright.effects.base import kept_response, slowed
from cellwright.effects.library.vocabulary import Effect, Parameter

# Knots of the logarithm of a resistance over SoC, from the middle to either end. A parameter is
# the change from one knot to the next: beyond the last SoC tested the resistance stays as it is.
TOWARDS_EMPTY = (0.35, 0.2, 0.1, 0.04, 0.0)
TOWARDS_FULL = (0.65, 0.8, 0.9, 1.0)
MIDDLE = 0.5


def _course(soc, steps):
    """Factor of a resistance at each SoC: straight in its logarithm between knots, 1 in the middle.

    steps : dict of the changes of the logarithm by name, see `_course_parameters`.
    """
    empty = np.cumsum([steps[_step_name(knot)] for knot in TOWARDS_EMPTY])
    full = np.cumsum([steps[_step_name(knot)] for knot in TOWARDS_FULL])
    knots = np.array([*TOWARDS_EMPTY[::-1], MIDDLE, *TOWARDS_FULL])
    return np.exp(np.interp(soc, knots, np.concatenate([empty[::-1], [0.0], full])))


def _step_name(knot):
    return f"step_to_{100 * knot:.0f}_percent"


def _kept_course(fields, stack, p):
    key = (_course, *p.values())
    return kept_response(stack, (fields.soc,), key, lambda: _course(fields.soc, p))


def _resistance_soc(fields, stack, p):
    return fields._replace(r0=fields.r0 * _kept_course(fields, stack, p))


def _polarisation_soc(fields, stack, p):
    return slowed(stack, fields, _kept_course(fields, stack, p))


def _asymmetry(fields, stack, p):
    more = 1.0 + p["charge_resistance_excess_relative"] * (fields.current > 0)
    return fields._replace(r0=fields.r0 * more)


def _lead(fields, stack, p):
    return fields._replace(r0=fields.r0 + p["resistance_ohm"])


def _course_parameters():
    """Changes of the logarithm of a resistance from knot to knot, outwards from half charge."""
    return tuple(
        Parameter(
            *(_step_name(knot), "1", 0.0, -3.0, 3.0),
            step=0.05,
            plausible=0.3,
            material=0.03,
            prior_std=0.7,
        )
        for knot in (*TOWARDS_EMPTY, *TOWARDS_FULL)
    )


EFFECTS = (
    Effect(
        id="resistance_asymmetry",
        sentence="the ohmic resistance differs between charge and discharge",
        parameters=(
            Parameter(
                "charge_resistance_excess_relative",
                "1",
                *(0.0, -0.8, 4.0),
                step=0.05,
                plausible=0.5,
                material=0.03,
            ),
        ),
        stage="resistance",
        act=_asymmetry,
        needs=("both_directions",),
        shows="pulses of the same size in both directions",
        consequence="voltage limits on charge and discharge are reached at other currents",
    ),
    Effect(
        id="resistance_soc",
        sentence="the ohmic resistance changes with the state of charge",
        parameters=_course_parameters(),
        stage="resistance",
        act=_resistance_soc,
        needs=("soc_range",),
        shows="pulses at ten or more states of charge",
        consequence="power near empty and full is not what the middle says",
    ),
    Effect(
        id="polarisation_soc",
        sentence="the polarisation (what relaxes) changes with the state of charge",
        parameters=_course_parameters(),
        stage="resistance",
        act=_polarisation_soc,
        needs=("soc_range",),
        shows="pulses with rests of ten minutes at ten or more states of charge",
        consequence="the voltage under lasting load is not what the middle says",
    ),
    Effect(
        id="lead_resistance",
        sentence="leads or contacts add a resistance to what the instrument sees",
        parameters=(Parameter("resistance_ohm", "Ohm", 0.0, 0.0, 0.05, step=1e-4, plausible=5e-3),),
        stage="resistance",
        act=_lead,
        shows="a four-wire reading, an impedance spectrum, or the resistance against temperature",
        consequence="the cell's own resistance is smaller than the model's",
    ),
)
