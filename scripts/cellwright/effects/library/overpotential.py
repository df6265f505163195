"""Effects of the overpotential: slow diffusion, charge transfer that is not ohmic, hysteresis."""

import numpy as np

from cellwright.circuits.circuit import KINDS
from cellwright.effects.base import kept_response
from cellwright.effects.library.quantities import fields_with
from cellwright.effects.library.sizes import MINUTE_SECOND
from cellwright.effects.library.vocabulary import Effect, Parameter, worded
from cellwright.numerics.hysteresis import preisach
from cellwright.numerics.lags import lag_fresh

# Kinds of branch of slow diffusion: an RC pair; a layer of finite length; a sphere; particles of an
# electrode, spheres at whose surface the OCV is (time constants: length² over diffusivity).
DIFFUSION_KINDS = ("RC", "warburg", "warburg_sphere", "diffusion")
# Slope of an OCV over SoC at which the surface's lead costs what the parameter tells in ohms.
USUAL_SLOPE_VOLT = 1.0
# Of hysteresis: one state, which every turn moves; stops, between which small loops close.
HYSTERESIS_KINDS = ("hysteresis", "preisach")
SMALL_RATE = 0.02  # of the capacity per hour: a current that charge transfer answers in proportion
KINETIC_SOC = (0.02, 0.98)  # beyond them an exchange current stays as it is


def _slow_diffusion_branch(p, r0_ohm, capacity_ampere_hour, soc):
    """Resistance and time constant are those at half charge; both go with one over D(SoC)."""
    slower = np.exp(-p["log_diffusivity_to_full"] * (np.clip(soc, 0.0, 1.0) - 0.5))
    kind, size = DIFFUSION_KINDS[int(p["finite_length"])], p["resistance_ohm"] * slower
    of_kind = {"soc_per_ampere": size / USUAL_SLOPE_VOLT} if _leads(p) else {"r_ohm": size}
    return r0_ohm, kind, of_kind | {"tau_second": p["time_constant_second"] * slower}


def _leads(p):
    """Whether diffusion moves the SoC at which the OCV is, and not a voltage."""
    return KINDS[DIFFUSION_KINDS[int(p["finite_length"])]].output == "soc"


def _slow_diffusion(fields, stack, p):
    """Lags whose clock runs with the diffusivity at the SoC, driven by the current as it is.

    dx/dt = R·I/τ − x/τ(z): what flows in does not depend on the diffusivity D, what evens out
    does, so that R(z)/τ(z) is one number. Of particles x is what their surface is ahead of the mean
    by, and its OCV the cell's: near empty, where the OCV is steep, a load ends earlier than any
    resistance would end it. In the cold they even out slower, as all time constants grow.

    Source: the sphere's response is Crank's (see `circuits.circuit.SPHERE_MODES`).
    """
    columns = fields.soc, fields.current, fields.tau_factor
    sizes = (_slow_diffusion, *(size for name, size in p.items() if name != "resistance_ohm"))
    of_one_ohm = kept_response(stack, columns, sizes, lambda: _diffusion_volt(fields, stack, p))
    at_usual_slope_volt = p["resistance_ohm"] * of_one_ohm
    if _leads(p):
        return fields._replace(lead=fields.lead + at_usual_slope_volt / USUAL_SLOPE_VOLT)
    return fields._replace(volt=fields.volt + at_usual_slope_volt)


def _diffusion_volt(fields, stack, p):
    """Voltage of slow diffusion with a resistance of one ohm (n,) [V]."""
    faster = np.exp(p["log_diffusivity_to_full"] * (np.clip(fields.soc, 0.0, 1.0) - 0.5))
    if _leads(p):
        faster = faster / fields.tau_factor
    kind, start = KINDS[DIFFUSION_KINDS[int(p["finite_length"])]], np.zeros(len(fields.soc))
    lags = kind.lags(tau_second=p["time_constant_second"])
    drive = fields.current / faster
    clock = stack.step_second * faster
    volts = (
        lag.share * lag_fresh(clock, stack.fresh, stack.linear, drive, lag.constant, start)
        for lag in lags
    )
    return sum(volts)


def _diffusion_sizes(effect, p, values):
    """By how much the particles' surface is ahead, or a resistance; and the time constant."""
    minutes = [("time constant", p["time_constant_second"] / MINUTE_SECOND, "min")]
    if _leads(p):
        lead = 100 * p["resistance_ohm"] / USUAL_SLOPE_VOLT
        return [("surface of the particles ahead by", lead, "% of SoC for each ampere"), *minutes]
    return [("", 1e3 * p["resistance_ohm"], "mΩ"), *minutes]


def _charge_transfer_branch(p, r0_ohm, capacity_ampere_hour, soc):
    """A share of R0 follows the Butler–Volmer equation, the rest stays ohmic.

    Over SoC the exchange current goes with (z·(1 − z))^e and the share's resistance with its
    inverse: their product is the thermal voltage, of which no electrode has another.
    """
    within, per_ampere = np.clip(soc, *KINETIC_SOC), p["per_exchange_current_per_ampere"]
    # Without kinetics no exchange current goes with the SoC either: the effect is absent.
    exponent = p["exchange_current_exponent"] if per_ampere > 0 else 0.0
    course = (4.0 * within * (1.0 - within)) ** exponent
    exchange = course / max(per_ampere, 1e-9)
    share = p["share_of_resistance"]
    parameters = {
        "r_ohm": share * r0_ohm / course,
        "exchange_ampere": exchange,
        "charge_coefficient": p["charge_coefficient"],
    }
    return (1.0 - share) * r0_ohm, "charge_transfer", parameters


def _charge_transfer(fields, stack, p):
    """R0 and the share only scale the voltage of charge transfer, which is kept for one ohm."""
    columns = fields.soc, fields.current, fields.exchange_factor
    share = p["share_of_resistance"]
    sizes = (_charge_transfer, *(size for name, size in p.items() if name != "share_of_resistance"))
    of_one_ohm = kept_response(stack, columns, sizes, lambda: _transfer_volt(fields, p))
    return fields._replace(ohmic=fields.r0 * ((1.0 - share) * fields.current + share * of_one_ohm))


def _transfer_volt(fields, p):
    """Voltage of charge transfer with a resistance of one ohm at half charge (n,) [V]."""
    alone = p | {"share_of_resistance": 1.0}
    _, kind, parameters = _charge_transfer_branch(alone, 1.0, None, fields.soc)
    parameters["exchange_ampere"] = parameters["exchange_ampere"] * fields.exchange_factor
    return KINDS[kind].drive(fields.current, **parameters)


def _switch_branch(p, r0_ohm, capacity_ampere_hour, soc):
    return r0_ohm, "switch", {"m_volt": p["amplitude_volt"]}


def _hysteresis_instant(fields, stack, p):
    return fields._replace(volt=fields.volt + p["amplitude_volt"] * stack.direction)


def _hysteresis_branch(p, r0_ohm, capacity_ampere_hour, soc):
    charge = capacity_ampere_hour / p["rate_per_soc"]
    parameters = {"m_volt": p["amplitude_volt"], "charge_ampere_hour": charge}
    return r0_ohm, HYSTERESIS_KINDS[int(p["small_loops_close"])], parameters


def _hysteresis_one_state(fields, stack, p):
    """dh = −g·|dSoC|·(h − s), s the sign of the current (thesis 2.16; Plett 2015, 2.65).

    Or the same along a whole charge or discharge, with small loops that close (`preisach`).
    """
    moved = fields.held * stack.step_second / 3600.0 + stack.unseen_ampere_hour
    if p["small_loops_close"]:
        through = p["rate_per_soc"] * moved / fields.capacity
        state = preisach(through, stack.direction, stack.fresh)
        return fields._replace(volt=fields.volt + p["amplitude_volt"] * state)
    passed = np.abs(moved) / fields.capacity
    sign = np.append(np.sign(fields.held[1:]), 0.0)
    zero_order = np.zeros(len(sign))
    constant = 1.0 / p["rate_per_soc"]
    state = lag_fresh(passed, stack.fresh, zero_order, sign, constant, stack.direction)
    return fields._replace(volt=fields.volt + p["amplitude_volt"] * state)


def _resistance_at_rates(effect, p, values):
    rates = np.array([-SMALL_RATE, -1.0, -3.0, 3.0])
    current = rates * values["capacity_ampere_hour"]
    ohm = fields_with(effect, p, values, current=current).ohmic / current
    names = ("R0 at small currents", "at 1C", "at 3C", "charging at 3C")
    return [(name, 1e3 * one, "mΩ") for name, one in zip(names, ohm, strict=True)]


def _half_distance(effect, p, values):
    return [("half the distance of charge and discharge", 1e3 * p["amplitude_volt"], "mV")]


def _half_distance_and_turn(effect, p, values):
    turned = "small turns close their loop, " if p["small_loops_close"] else ""
    name = f"{turned}turned over within"
    return [*_half_distance(effect, p, values), (name, 100 / p["rate_per_soc"], "% of SoC")]


def _amplitude(largest_volt):
    return Parameter(*("amplitude_volt", "V", 0.0, 0.0, largest_volt), step=1e-3, plausible=0.02)


# A third RC pair, Warburg elements and diffusion in particles are one class: the one that fits best
# is taken. The first two no protocol of eleven tells apart (missing-effect study).
EFFECTS = worded(
    Effect(
        id="hysteresis_instant",
        parameters=(_amplitude(0.1),),
        stage="overpotential",
        act=_hysteresis_instant,
        circuit=_switch_branch,
        needs=("both_directions",),
        slow_gap="hysteresis",
        quantity="half_gap",
        sizes_in_words=_half_distance,
        in_particle="hysteresis",
    ),
    Effect(
        id="hysteresis_one_state",
        parameters=(
            _amplitude(0.2),
            Parameter("rate_per_soc", "1", 20.0, 2.0, 200.0, step=2.0, shape=True),
            # Number of the kind in HYSTERESIS_KINDS. Tried, not fitted.
            Parameter("small_loops_close", "1", 0.0, 0.0, 1.0, step=0.0, shape=True),
        ),
        stage="overpotential",
        act=_hysteresis_one_state,
        circuit=_hysteresis_branch,
        starts=tuple(
            {"rate_per_soc": rate, "small_loops_close": form}
            for form in (0.0, 1.0)
            for rate in (4.0, 12.0, 40.0)
        ),
        needs=("both_directions",),
        slow_gap="hysteresis",
        quantity="half_gap",
        sizes_in_words=_half_distance_and_turn,
        in_particle="hysteresis",
    ),
    Effect(
        id="slow_diffusion",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 0.0, 0.0, 0.2, step=1e-3, plausible=0.01),
            Parameter("time_constant_second", "s", 2000.0, 100.0, 1e5, step=20.0, shape=True),
            # Titration finds diffusivities within a decade between empty and full: two deviations.
            Parameter(
                *("log_diffusivity_to_full", "1", 0.0, -2.3, 2.3),
                step=0.05,
                shape=True,
                prior_std=1.15,
            ),
            # Number of the kind in DIFFUSION_KINDS. Tried, not fitted.
            Parameter("finite_length", "1", 0.0, 0.0, 3.0, step=0.0, shape=True),
        ),
        stage="diffusion",
        act=_slow_diffusion,
        circuit=_slow_diffusion_branch,
        starts=tuple(
            {"time_constant_second": second, "finite_length": form}
            for form, seconds in (
                (0.0, (800.0, 2500.0, 8000.0)),
                (1.0, (300.0, 1200.0, 5000.0)),
                (2.0, (2000.0, 8000.0, 30000.0)),
                (3.0, (2000.0, 8000.0, 30000.0)),
            )
            for second in seconds
        ),
        needs=("long_rest",),
        slow_gap="resistance",
        quantity="slow_resistance",
        sizes_in_words=_diffusion_sizes,
        of_branch=True,
        in_particle="diffusion",
    ),
    Effect(
        id="charge_transfer_nonlinearity",
        parameters=(
            Parameter(
                "per_exchange_current_per_ampere", "1/A", 0.0, 0.0, 20.0, step=0.02, plausible=0.5
            ),
            Parameter("share_of_resistance", "1", 0.7, 0.05, 1.0, step=0.05, shape=True),
            # One half in a particle by its own state of charge, of which a cell uses a part.
            Parameter(
                *("exchange_current_exponent", "1", 0.0, 0.0, 1.0),
                step=0.02,
                shape=True,
                prior_std=0.5,
            ),
            # One half for a step of one electron, 0.3 to 0.7 as measured.
            Parameter(
                "charge_coefficient", "1", 0.5, 0.2, 0.8, step=0.01, shape=True, prior_std=0.1
            ),
        ),
        stage="overpotential",
        act=_charge_transfer,
        circuit=_charge_transfer_branch,
        starts=tuple(
            {"per_exchange_current_per_ampere": size, "exchange_current_exponent": exponent}
            for exponent in (0.0, 0.5)
            for size in (0.15, 0.6, 2.5)
        ),
        needs=("rates",),
        quantity="large_over_small",
        sizes_in_words=_resistance_at_rates,
        sizes_need_model=True,
        of_branch=True,
        in_particle="kinetics",
    ),
)
