"""Quantities that other measurements read, as an effect of a model implies them.

Each lets the effect act on the plain model's resistances, capacity and OCV under the
conditions of the measurement, so that none depends on the formula that an effect has.
"""

import numpy as np

from cellwright.effects.base import LOGARITHMS, Fields, slow_volt
from cellwright.effects.records import Stack
from cellwright.numerics.lines import GAS_CONSTANT, ZERO_CELSIUS_KELVIN
from cellwright.records.conditions import REFERENCE_CELSIUS

MIDDLE_SOC = 0.5
STEP_SECOND = 10.0  # of a record made for a rest
EARLIER_SECOND = 600.0  # of a rest: what relaxes later is slow, as the plain model's longest tau2


def fields_with(effect, p, values, *, soc=MIDDLE_SOC, celsius=REFERENCE_CELSIUS, **about):
    """Fields of the plain model with one effect, at given conditions, see `fields_at`.

    Parameters
    ----------
    effect : Effect or None. p : dict of its parameters by name. values : dict of the plain model.
    soc : (n,) or scalar [1]. celsius : [degC].

    Returns
    -------
    fields : base.Fields, (n,) each; `volt` is the effect's own.
    """
    acting = [] if effect is None else [(effect, p)]
    return fields_at(values, acting, soc=soc, celsius=celsius, **about)


def fields_at(values, acting, *, soc, celsius, current=-1.0, step=None, age=None, **columns):
    """Fields of the plain model with some effects, at given conditions.

    Parameters
    ----------
    values : dict of the plain model. acting : list of (Effect, its parameters by name), in order.
    soc, celsius, current : (n,) or scalar [1], [degC], [A]. step : time between rows [s], None:
        rows do not hang together. age : (n,), see `records.Stack`, None: that of the model.
    columns : further fields, in the place of those of the plain model.

    Returns
    -------
    fields : base.Fields, (n,) each; `volt` is that of the effects.
    """
    given = np.broadcast_arrays(soc, celsius, current)
    soc, celsius, current = (np.atleast_1d(np.array(v, float)) for v in given)
    one, none = np.ones(len(soc)), np.zeros(len(soc))
    r0, r1, tau1, r2, tau2 = (float(np.exp(values.get(name, 0.0))) for name in LOGARITHMS)
    capacity = values.get("capacity_ampere_hour", 1.0)
    fields = Fields(
        *(current, current, none, capacity * one, soc, celsius, r0 * one, r1 * one, r2 * one),
        *(tau1, tau2, (one, one), 1.0, none, r0 * current, none),
    )
    fields, rows = fields._replace(**columns), rows_at(current, celsius, step)
    if age is not None:  # each row is of a record of its own
        rows = rows._replace(file=np.arange(len(soc)), age=np.asarray(age, float))
    for effect, p in acting:
        fields = effect.act(fields, rows, p)
        if effect.stage != "overpotential":  # kinetics follow from R0, which is known by then
            fields = fields._replace(ohmic=fields.r0 * fields.current)
    return fields


def rows_at(current, celsius, step=None):
    """Stack of rows with currents (n,) [A] at temperatures (n,) [degC], see `fields_with`."""
    none = np.zeros(len(current))
    fresh = np.append(1.0, none[1:])
    steps = none if step is None else np.where(fresh > 0, 0.0, step)
    return Stack(
        tests=("",),
        first=np.zeros(1, int),
        file=np.zeros(len(current), int),
        second=np.cumsum(steps),
        step_second=steps,
        fresh=fresh,
        current_ampere=current,
        voltage_volt=none,
        celsius=celsius,
        hold="zero_order",
        soc_at_start=np.ones(1),
        kinds=("drive",),
        held_ampere=current,
        linear=none,
        direction=np.sign(current),
        template_volt=none,
        used=none == 0,
        unseen_ampere_hour=none,
        responses={},
        courses={},
        stated=np.zeros(1, bool),
    )


def _total(fields):
    return fields.r0 + sum(fields.slow_ohm)


def _activation_energy(effect, p, values, at):
    """Of the sum of all resistances between two temperatures [J/mol]."""
    cold, warm = at
    ohm = _total(fields_with(effect, p, values, celsius=[cold, warm]))
    kelvin = np.array([cold, warm]) + ZERO_CELSIUS_KELVIN
    return GAS_CONSTANT * float(np.log(ohm[0] / ohm[1]) / (1 / kelvin[0] - 1 / kelvin[1]))


def _ohmic_over_soc(effect, p, values, at):
    low, high = fields_with(effect, p, values, soc=at).r0
    return float(low / high)


def _relaxing_over_soc(effect, p, values, at):
    fields = fields_with(effect, p, values, soc=at)
    low, high = sum(fields.slow_ohm)
    return float(low / high)


def _charge_over_discharge(effect, p, values, at):
    discharge, charge = fields_with(effect, p, values, current=[-at[0], at[0]]).r0
    return float(charge / discharge)


def _large_over_small(effect, p, values, at):
    small, large = np.abs(at)
    ohmic = fields_with(effect, p, values, current=[-small, -large]).ohmic
    return float((ohmic[1] / large) / (ohmic[0] / small))


def _slow_resistance(effect, p, values, at):
    """Voltage that relaxes between 10 min and the end of a rest, per ampere of its load [ohm].

    NaN where diffusion moves the SoC of the OCV: then it goes with the slope of the OCV.
    """
    load, rest = (int(np.ceil(second / STEP_SECOND)) for second in at)
    current = np.append(np.full(load + 1, -1.0), np.zeros(rest))
    fields = fields_with(effect, p, values, current=current, step=STEP_SECOND)
    if np.any(fields.lead):
        return np.nan
    pairs = slow_volt(rows_at(current, fields.celsius, STEP_SECOND), fields)
    volt = fields.volt + pairs
    return float(volt[-1] - volt[load + int(EARLIER_SECOND / STEP_SECOND)])


def _half_gap(effect, p, values, at):
    return float(p[effect.parameters[0].name])


def _current_at_rest(effect, p, values, at):
    fields = fields_with(effect, p, values, current=[0.0])
    return -float(fields.current[0])


def _nothing(effect, p, values, at):
    """The logged current at rest of a leak, which passes the ammeter by."""
    return 0.0


def _not_read(effect, p, values, at):
    """The rise of the core over the surface, which no sensor reads."""
    return np.nan


def _ocv_per_kelvin(effect, p, values, at):
    """Mean slope of the OCV over temperature within a range of SoC [V/K]."""
    soc = np.linspace(*at, 21)
    warm, cold = (fields_with(effect, p, values, soc=soc, celsius=c).ocv for c in (26.0, 25.0))
    return float(np.mean(warm - cold))


def _capacity_per_kelvin(effect, p, values, at):
    cold, warm = at
    ampere_hour = fields_with(effect, p, values, celsius=[cold, warm]).capacity
    middle = fields_with(effect, p, values).capacity[0]
    return float((ampere_hour[1] - ampere_hour[0]) / (warm - cold) / middle)


def _capacity_change(effect, p, values, at):
    now, before = (fields_with(one, p, values).capacity[0] for one in (effect, None))
    return float(now / before - 1.0)


def _capacity_over_days(effect, p, values, at):
    """Change of the capacity in so many days between tests [1]; NaN where no dates were known."""
    if not values.get("aged_day"):
        return np.nan
    ages, pair = [0.0, at[0] / values["aged_day"]], [MIDDLE_SOC, MIDDLE_SOC]
    before, later = fields_with(effect, p, values, soc=pair, age=ages).capacity
    return float(later / before - 1.0)


def _ocv_change(effect, p, values, at):
    """RMS change of the OCV within a range of SoC [V]."""
    soc = np.linspace(*at, 41)
    return float(np.sqrt(np.mean(fields_with(effect, p, values, soc=soc).ocv ** 2)))


QUANTITIES = {
    "activation_energy": _activation_energy,
    "ohmic_over_soc": _ohmic_over_soc,
    "relaxing_over_soc": _relaxing_over_soc,
    "charge_over_discharge": _charge_over_discharge,
    "large_over_small": _large_over_small,
    "slow_resistance": _slow_resistance,
    "half_gap": _half_gap,
    "current_at_rest": _current_at_rest,
    "no_current_at_rest": _nothing,
    "core_rise": _not_read,
    "ocv_per_kelvin": _ocv_per_kelvin,
    "capacity_per_kelvin": _capacity_per_kelvin,
    "capacity_change": _capacity_change,
    "capacity_over_days": _capacity_over_days,
    "ocv_change": _ocv_change,
}
