"""Effects of the ohmic resistance and of the polarisation."""

import numpy as np

from cellwright.effects.base import kept_response, slowed
from cellwright.effects.library.sizes import as_is, over_soc, resistance_by_direction
from cellwright.effects.library.vocabulary import Effect, Parameter, Tie, worded

# Knots of a course over SoC (logarithm of a resistance, entropic coefficient), from the middle to
# either end. A parameter is the change from one knot to the next: beyond the last SoC tested the
# course stays as it is.
TOWARDS_EMPTY = (0.35, 0.2, 0.1, 0.04, 0.0)
TOWARDS_FULL = (0.65, 0.8, 0.9, 1.0)
KNOTS = np.array([*TOWARDS_EMPTY[::-1], 0.5, *TOWARDS_FULL])
CHANGE_OF_EXCESS = {"step": 0.05, "plausible": 0.3, "prior_std": 0.3}
LEAST_ON_CHARGE = 0.05  # of the resistance on discharge
DIFFUSION_OHM = "slow_diffusion.resistance_ohm"  # what relaxes does so in diffusion, too
QUICKER = "excess_of_quicker_pair"  # of the logarithm of its course over the mean of both


def _course(soc, steps):
    """Factor of a resistance at each SoC: straight in its logarithm between knots, 1 in the middle.

    steps : dict of the changes of the logarithm by name, see `course_parameters`.
    """
    return np.exp(_log_course(soc, steps))


def _log_course(soc, steps):
    return np.interp(soc, KNOTS, at_knots(steps))


def at_knots(steps):
    """Course at each of the knots over SoC, from empty to full, less that at half charge.

    steps : dict of its changes from knot to knot by name, see `course_parameters`; their unit.
    """
    empty = np.cumsum([steps[_step_name(knot)] for knot in TOWARDS_EMPTY])
    full = np.cumsum([steps[_step_name(knot)] for knot in TOWARDS_FULL])
    return np.concatenate([empty[::-1], [0.0], full])


def _step_name(knot):
    return f"step_to_{100 * knot:.0f}_percent"


def _kept_course(fields, stack, p):
    key = (_course, *p.values())
    return kept_response(stack, (fields.soc,), key, lambda: _course(fields.soc, p))


def _resistance_soc(fields, stack, p):
    return fields._replace(r0=fields.r0 * _kept_course(fields, stack, p))


def _polarisation_soc(fields, stack, p):
    """One course, which either pair may follow more: charge transfer and diffusion differ."""
    quicker = p[QUICKER]
    steps = {name: size for name, size in p.items() if name != QUICKER}
    if quicker == 0.0:
        course = _kept_course(fields, stack, steps)
        return slowed(stack, fields, (course, course))
    key = _log_course, *steps.values()
    log = kept_response(stack, (fields.soc,), key, lambda: _log_course(fields.soc, steps))
    # A power of the course, by its logarithm: half of the time.
    powers, key = (1.0 + quicker, 1.0 - quicker), (_polarisation_soc, quicker)
    both = kept_response(stack, (log,), key, lambda: tuple(np.exp(one * log) for one in powers))
    return slowed(stack, fields, both)


def _excesses(p):
    """What a charge meets more than a discharge, empty, at half charge and full (3,) [1]."""
    middle = p["charge_resistance_excess_relative"]
    return np.array([middle + p["change_to_empty"], middle, middle + p["change_to_full"]])


def _asymmetry(fields, stack, p):
    """On a charge the resistance is larger by an excess that runs straight from half charge."""
    columns, key = (fields.soc, fields.current), (_asymmetry, *p.values())
    more = kept_response(stack, columns, key, lambda: _by_direction(fields, p))
    if p["in_quicker_pair"]:
        return slowed(stack, fields, (more, 1.0))
    return fields._replace(r0=fields.r0 * more)


def _by_direction(fields, p):
    excess = np.interp(fields.soc, (0.0, 0.5, 1.0), _excesses(p))
    return np.where(fields.current > 0, np.maximum(1.0 + excess, LEAST_ON_CHARGE), 1.0)


def _lead(fields, stack, p):
    return fields._replace(r0=fields.r0 + p["resistance_ohm"])


def course_parameters(unit="1", *, most=3.0, **about):
    """Changes of a course from knot to knot, outwards from half charge; of a logarithm by default.

    most : largest change, unit as given. about : of each, see vocabulary.Parameter.
    """
    about = about or {"step": 0.05, "plausible": 0.3, "prior_std": 0.7}
    return tuple(
        Parameter(_step_name(knot), unit, 0.0, -most, most, **about)
        for knot in (*TOWARDS_EMPTY, *TOWARDS_FULL)
    )


LEAD_CHECK = "a four-wire reading, an impedance spectrum, or the resistance against temperature"
EFFECTS = worded(
    Effect(
        id="resistance_asymmetry",
        parameters=(
            Parameter(
                "charge_resistance_excess_relative", "1", 0.0, -0.8, 4.0, step=0.05, plausible=0.5
            ),
            *(
                Parameter(f"change_to_{end}", "1", 0.0, -2.0, 2.0, **CHANGE_OF_EXCESS)
                for end in ("empty", "full")
            ),
            # 0: of the ohmic resistance, 1: of the quicker pair. Tried, not fitted.
            Parameter("in_quicker_pair", "1", 0.0, 0.0, 1.0, step=0.0, shape=True),
        ),
        stage="resistance",
        act=_asymmetry,
        starts=({"in_quicker_pair": 0.0}, {"in_quicker_pair": 1.0}),
        needs=("both_directions",),
        quantity="charge_over_discharge",
        sizes_in_words=resistance_by_direction,
        sizes_need_model=True,
        of_branch=True,
    ),
    Effect(
        id="resistance_soc",
        parameters=course_parameters(),
        stage="resistance",
        act=_resistance_soc,
        needs=("soc_range",),
        in_healthy_cells=True,
        quantity="ohmic_over_soc",
        sizes_in_words=over_soc("R0", lambda fields: fields.r0),
        sizes_need_model=True,
        of_branch=True,
        in_particle="ohmic_soc",
    ),
    Effect(
        id="polarisation_soc",
        parameters=(
            *course_parameters(),
            # 0: both pairs alike, 1: the quicker alone. The slower alone is an error of the OCV.
            Parameter(QUICKER, "1", 0.0, 0.0, 1.0, step=0.02, shape=True, prior_std=0.7),
        ),
        stage="resistance",
        act=_polarisation_soc,
        needs=("soc_range",),
        in_healthy_cells=True,
        quantity="relaxing_over_soc",
        sizes_in_words=over_soc("what relaxes", lambda fields: sum(fields.slow_ohm), DIFFUSION_OHM),
        sizes_need_model=True,
        of_branch=True,
        in_particle="relaxing_soc",
    ),
    Effect(
        id="lead_resistance",
        parameters=(Parameter("resistance_ohm", "Ohm", 0.0, 0.0, 0.05, step=1e-4, plausible=5e-3),),
        stage="resistance",
        act=_lead,
        shows=LEAD_CHECK,
        ties=(Tie("the cell's own ohmic resistance", LEAD_CHECK, always=True, exact=True),),
        sizes_in_words=as_is("resistance_ohm", "mΩ", factor=1e3),
    ),
)
