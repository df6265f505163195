"""Effects of the ohmic resistance and of the polarisation."""

import numpy as np

from cellwright.effects.library.vocabulary import Effect, Parameter

DECAY_SOC = 0.15


def _courses(soc, towards_empty, falling, bowl):
    """Factor over SoC: three shapes in the logarithm, each zero in the middle."""
    soc = np.clip(soc, 0.0, 1.0)
    low = np.exp(-soc / DECAY_SOC) - np.exp(-0.5 / DECAY_SOC)
    return np.exp(towards_empty * low + falling * (0.5 - soc) + bowl * 4 * (soc - 0.5) ** 2)


def _resistance_soc(fields, stack, p):
    return fields._replace(r0=fields.r0 * _courses(fields.soc, **p))


def _polarisation_soc(fields, stack, p):
    factor = _courses(fields.soc, **p)
    return fields._replace(r1=fields.r1 * factor, r2=fields.r2 * factor)


def _asymmetry(fields, stack, p):
    more = 1.0 + p["charge_resistance_excess_relative"] * (fields.current > 0)
    return fields._replace(r0=fields.r0 * more)


def _lead(fields, stack, p):
    return fields._replace(r0=fields.r0 + p["resistance_ohm"])


def _course_parameters(most):
    names = ("towards_empty", "falling", "bowl")
    return tuple(
        Parameter(name, "1", 0.0, -most, most, step=0.05, plausible=0.5, material=0.05)
        for name in names
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
        parameters=_course_parameters(4.0),
        stage="resistance",
        act=_resistance_soc,
        needs=("soc_range",),
        shows="pulses at ten or more states of charge",
        consequence="power near empty and full is not what the middle says",
    ),
    Effect(
        id="polarisation_soc",
        sentence="the polarisation (what relaxes) changes with the state of charge",
        parameters=_course_parameters(4.0),
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
