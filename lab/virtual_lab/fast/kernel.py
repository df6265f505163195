"""One internal step of cells in parallel: voltages, branch currents, new states.

Within a step the current runs straight from its old value to the one tried, and every parameter is
held; so each exponential is followed exactly. A step of no length is an edge: only the current
changes. `packed`, `state`, `work` are Pack, State and Work of `parameters`; j is the cell's
number.

A single cell is a group of one. Unknown are the branch currents at the end of the step, for which
all branches have one voltage; Newton's method finds them. Kirchhoff's laws are linear and hold to
rounding.
"""

import hashlib
import math
import os
from pathlib import Path

try:
    import numba
except ImportError:
    numba = None


def _folder() -> Path | None:
    """Folder in which machine code is kept between runs, if it can be written.

    Its name is the hash of all that is compiled, for numba's own cache does not see edits in
    imported modules.
    """
    files = sorted(Path(__file__).parent.glob("*.py"))
    version = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(home) / "virtual_lab" / version
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder


def _compiler():
    """numba's decorator for functions on arrays and numbers; none where numba is not installed."""
    if numba is None:
        return lambda function: function
    folder = _folder()
    if folder is not None:
        numba.config.CACHE_DIR = str(folder)
    # A tuple of thirty arrays is handed down at every internal step. Inlined, and with no counting
    # of references (nothing is allocated; the caller holds the arrays), that costs nothing: 0.3
    # instead of 2.2 microseconds per step.
    return numba.njit(cache=folder is not None, error_model="numpy", forceinline=True, _nrt=False)


njit = _compiler()


ZERO_CELSIUS_KELVIN = 273.15
REFERENCE_CELSIUS = 25.0
GAS_CONSTANT = 8.314462618


@njit
def straight(table, soc):
    """Value of an evenly spaced table over 0 … 1 by straight lines; constant beyond its ends."""
    last = table.size - 1
    x = min(max(soc, 0.0), 1.0) * last
    k = min(int(x), last - 1)
    return table[k] + (x - k) * (table[k + 1] - table[k])


@njit
def smooth(table, slopes, soc):
    """Value and slope of an evenly spaced table over 0 … 1 by cubics; straight beyond its ends."""
    last = table.size - 1
    if soc <= 0.0:
        return table[0] + slopes[0] * soc, slopes[0]
    if soc >= 1.0:
        return table[last] + slopes[last] * (soc - 1.0), slopes[last]
    k = int(soc * last)
    u = soc * last - k
    first, second = slopes[k], slopes[k + 1]
    secant = (table[k + 1] - table[k]) * last
    bend = 3.0 * secant - 2.0 * first - second
    twist = first + second - 2.0 * secant
    value = table[k] + u / last * (first + u * (bend + u * twist))
    return value, first + u * (2.0 * bend + 3.0 * u * twist)


@njit
def arrhenius(energy, celsius):
    """Factor of an activation energy [J/mol], 1 at 25 °C; above 1 in the cold."""
    if energy == 0.0:
        return 1.0
    warm = 1.0 / (ZERO_CELSIUS_KELVIN + REFERENCE_CELSIUS)
    return math.exp(energy / GAS_CONSTANT * (1.0 / (ZERO_CELSIUS_KELVIN + celsius) - warm))


@njit
def chamber_at(packed, j, second):
    """Temperature [°C] around a cell at a time [s] of its test."""
    times, celsius = packed.chamber_second, packed.chamber_celsius[j]
    if second <= times[0]:
        return celsius[0]
    if second >= times[-1]:
        return celsius[-1]
    low, high = 0, times.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= second:
            low = middle
        else:
            high = middle
    share = (second - times[low]) / (times[high] - times[low])
    return celsius[low] + share * (celsius[high] - celsius[low])


@njit
def stored_current(packed, j, ampere):
    """Part of the current through the cell [A] that changes the state of charge [A]."""
    return ampere * packed.efficiency[j] if ampere > 0.0 else ampere


@njit
def ohmic(packed, work, j, ampere):
    """Voltage [V] over the ohmic element, and its slope [ohm]; `ampere` flows through the cell."""
    r = work.r0[j] * (1.0 + packed.asymmetry[j]) if ampere > 0.0 else work.r0[j]
    share, scale = packed.kinetic_share[j], packed.kinetic_volt[j]
    if scale == 0.0:
        return r * ampere, r
    x = share * r * ampere / scale
    volt = (1.0 - share) * r * ampere + scale * math.asinh(x)
    return volt, (1.0 - share) * r + share * r / math.sqrt(1.0 + x * x)


@njit
def next_temperatures(packed, state, work, j, second, dt):
    """Temperature of the core and hidden temperature rise at the end of a step.

    The ohmic heat is the mean along the straight current (Simpson's rule), with the resistance of
    the step before; the rest of the heat is held.
    """
    before, after = state.current[j] - packed.leak[j], work.current[j] - packed.leak[j]
    middle = 0.5 * (before + after)
    heat = before * ohmic(packed, work, j, before)[0] + after * ohmic(packed, work, j, after)[0]
    heat = (heat + 4.0 * middle * ohmic(packed, work, j, middle)[0]) / 6.0 + state.heat[j]
    if packed.heat_capacity[j] == 0.0:
        work.core[j] = chamber_at(packed, j, second)
    else:
        resistance = packed.core_resistance[j] + packed.surface_resistance[j]
        decay = math.exp(-dt / (packed.heat_capacity[j] * resistance))
        end = chamber_at(packed, j, second - 0.5 * dt) + resistance * heat
        work.core[j] = end + (state.core[j] - end) * decay
    if packed.rise_tau[j] > 0.0:
        end = packed.rise_resistance[j] * heat
        work.rise[j] = end + (state.rise[j] - end) * math.exp(-dt / packed.rise_tau[j])
    else:
        work.rise[j] = packed.rise_resistance[j] * heat


@njit
def _parameters_at(packed, work, j, celsius):
    """Resistances and time constants at a temperature, and by the hidden temperature rise."""
    work.celsius[j] = celsius
    risen = arrhenius(packed.rise_energy[j], REFERENCE_CELSIUS + work.rise[j])
    work.r0_warm[j] = risen * packed.r0[j] * arrhenius(packed.r0_energy[j], celsius)
    for e in range(packed.r.shape[1]):
        work.r_warm[j, e] = risen * packed.r[j, e] * arrhenius(packed.r_energy[j, e], celsius)
        work.tau[j, e] = packed.tau[j, e] * arrhenius(packed.tau_energy[j, e], celsius)


@njit
def _decays(packed, work, j, dt):
    """Share of each exponential that remains after a step, and what straight currents add."""
    work.second[j] = dt
    for e in range(packed.r.shape[1]):
        x = dt / work.tau[j, e]
        gone = -math.expm1(-x)
        # gone / x loses digits for small x, where the series is exact enough.
        held = 1.0 - gone / x if x > 1e-4 else 0.5 * x - x * x / 6.0
        work.decay[j, e] = 1.0 - gone
        work.new[j, e] = held
        work.old[j, e] = gone - held


@njit
def _factor(packed, j, e, soc):
    if packed.flat[j, e]:
        return packed.factor[j, e, 0]
    return straight(packed.factor[j, e], soc)


@njit
def hold_parameters(packed, state, work, j, second, dt):
    """Set the parameters of a step: at its mean charge, the ohmic ones at its end.

    `work.current` holds the current that is expected at the end.
    """
    celsius = work.core[j] + work.rise[j]
    if celsius != work.celsius[j]:
        _parameters_at(packed, work, j, celsius)
        work.second[j] = -1.0
    if dt != work.second[j]:
        _decays(packed, work, j, dt)
    # The chamber's temperature, not the core's: a cell that warms itself must not gain charge.
    warmer = chamber_at(packed, j, second) - REFERENCE_CELSIUS
    work.coulomb[j] = packed.coulomb[j] + packed.coulomb_per_kelvin[j] * warmer
    before = state.current[j] - packed.leak[j]
    flow = stored_current(packed, j, before) + stored_current(
        packed, j, work.current[j] - packed.leak[j]
    )
    half = 0.25 * dt * flow / work.coulomb[j]
    drift = 1.0 + packed.drift_per_second[j] * second
    work.r0[j] = work.r0_warm[j] * drift * _factor(packed, j, 0, state.soc[j] + 2.0 * half)
    work.carried[j] = 0.0
    work.gain[j] = 0.0
    for e in range(packed.r.shape[1]):
        r = work.r_warm[j, e] * _factor(packed, j, e + 1, state.soc[j] + half)
        work.r[j, e] = r
        work.carried[j] += work.decay[j, e] * state.element[j, e] + r * work.old[j, e] * before
        work.gain[j] += r * work.new[j, e]


@njit
def next_soc(packed, state, work, j, dt, ampere):
    """State of charge and hysteresis h at the end of a step for a current tried; and dsoc/dA."""
    before, after = state.current[j] - packed.leak[j], ampere - packed.leak[j]
    per_ampere = 0.5 * dt / work.coulomb[j]
    passed = per_ampere * (stored_current(packed, j, before) + stored_current(packed, j, after))
    target = 1.0 if passed > 0.0 else -1.0
    decay = math.exp(-packed.hysteresis_per_soc[j] * abs(passed))
    return state.soc[j] + passed, target + (state.hysteresis[j] - target) * decay, per_ampere


@njit
def terminal(packed, state, work, j, dt, ampere):
    """Voltage behind the wire at the end of a step for a current tried, and its slope [ohm]."""
    soc, h, per_ampere = next_soc(packed, state, work, j, dt, ampere)
    volt, slope = smooth(packed.ocv[j], packed.ocv_slope[j], soc)
    if work.core[j] != REFERENCE_CELSIUS:
        volt += straight(packed.entropic[j], soc) * (work.core[j] - REFERENCE_CELSIUS)
    lost, resistance = ohmic(packed, work, j, ampere - packed.leak[j])
    through = ampere - packed.leak[j]
    volt += work.carried[j] + work.gain[j] * through + lost + packed.wire[j] * ampere
    volt += packed.hysteresis[j] * h + packed.instant[j] * work.direction[j]
    distance = 1.0 - h if soc > state.soc[j] else 1.0 + h
    turn = packed.hysteresis[j] * packed.hysteresis_per_soc[j] * distance
    slope = (max(slope, 0.0) + turn) * per_ampere
    return volt, slope + resistance + work.gain[j] + packed.wire[j]


@njit
def commit_cell(packed, state, work, j, dt):
    """Make the tried end of a step the cell's state, with its heat but for the ohmic element's.

    A current I gives I·(V - U) + I·T·dU/dT, counted positive on charge. The voltage over an
    exponential heats by v²/r: the difference to I·v goes to its capacity, or comes from it.
    """
    ampere = work.current[j]
    before, after = state.current[j] - packed.leak[j], ampere - packed.leak[j]
    soc, h, _ = next_soc(packed, state, work, j, dt, ampere)
    kelvin = ZERO_CELSIUS_KELVIN + work.core[j]
    heat = after * kelvin * straight(packed.entropic[j], soc)
    heat += after * (packed.hysteresis[j] * h + packed.instant[j] * work.direction[j])
    for e in range(packed.r.shape[1]):
        r = work.r[j, e]
        volt = work.decay[j, e] * state.element[j, e]
        volt += r * (work.old[j, e] * before + work.new[j, e] * after)
        state.element[j, e] = volt
        heat += volt * volt / r if r > 0.0 else 0.0
    state.soc[j], state.hysteresis[j] = soc, h
    state.core[j], state.rise[j] = work.core[j], work.rise[j]
    state.direction[j], state.current[j], state.heat[j] = work.direction[j], ampere, heat


@njit
def slow_voltage(packed, state, work, j):
    """The part of the voltage that does not follow the current at once [V], and its rate [V/s]."""
    through = state.current[j] - packed.leak[j]
    flow = stored_current(packed, j, through) / work.coulomb[j]
    volt, slope = smooth(packed.ocv[j], packed.ocv_slope[j], state.soc[j])
    rate = slope * flow
    for e in range(packed.r.shape[1]):
        volt += state.element[j, e]
        rate += (work.r[j, e] * through - state.element[j, e]) / work.tau[j, e]
    target = 1.0 if flow > 0.0 else -1.0
    h = state.hysteresis[j]
    volt += packed.hysteresis[j] * h
    rate += packed.hysteresis[j] * packed.hysteresis_per_soc[j] * abs(flow) * (target - h)
    return volt, rate


MOST = 120
UNDAMPED = 20
CLOSE_AMPERE = 1e-11


@njit
def advance(packed, state, work, second, dt, hold, target):
    """Try one internal step that ends at `second` of the test; the tried state is in `work`.

    The group's current becomes `target` [A], or, where `hold` is set, its voltage [V]. Gives that
    voltage; NaN: no branch currents were found.
    """
    n = state.soc.size
    extra = 0.0 if hold else (target - state.current.sum()) / n
    for j in range(n):
        work.direction[j] = state.direction[j]
        work.current[j] = state.current[j] + extra
        next_temperatures(packed, state, work, j, second, dt)
        hold_parameters(packed, state, work, j, second, dt)
    volt = _settle(packed, state, work, dt, hold, target)
    if _switched(packed, work):
        volt = _settle(packed, state, work, dt, hold, target)
        if _switched_back(state, work):
            volt = _settle(packed, state, work, dt, hold, target)
    return volt


@njit
def _settle(packed, state, work, dt, hold, target):
    """Branch currents for which all branches have one voltage; gives that voltage."""
    if state.soc.size == 1 and not hold:
        work.current[0] = target
        return terminal(packed, state, work, 0, dt, target)[0]
    for k in range(MOST):
        # Kinks (asymmetry) and steep kinetics can send Newton's method round in a circle.
        damping = 1.0 if k < UNDAMPED else 0.5
        change, common = _newton(packed, state, work, dt, hold, target, damping)
        if change < CLOSE_AMPERE:
            return common
    return math.nan


@njit
def _newton(packed, state, work, dt, hold, target, damping):
    """One Newton step of all currents; gives the largest change [A] and the common voltage."""
    n = state.soc.size
    conductance, weighted, flowing = 0.0, 0.0, 0.0
    for j in range(n):
        work.volt[j], work.slope[j] = terminal(packed, state, work, j, dt, work.current[j])
        conductance += 1.0 / work.slope[j]
        weighted += work.volt[j] / work.slope[j]
        flowing += work.current[j]
    common = target if hold else (target - flowing + weighted) / conductance
    most = 0.0
    for j in range(n):
        change = (common - work.volt[j]) / work.slope[j]
        work.current[j] += damping * change
        most = max(most, abs(change) / (1.0 + abs(work.current[j])))
    return most, common


@njit
def _switched(packed, work):
    """Whether a current above the threshold has changed its sign; the sign is set anew."""
    switched = False
    for j in range(work.current.size):
        sign = 1.0 if work.current[j] > 0.0 else -1.0
        counts = abs(work.current[j]) > packed.threshold[j] and packed.instant[j] != 0.0
        if counts and sign != work.direction[j]:
            work.direction[j] = sign
            switched = True
    return switched


@njit
def _switched_back(state, work):
    """Whether a cell's voltage jump reversed its own current again; such a jump is not made.

    Beside other cells it would be made and undone for ever, as by a relay without hysteresis.
    """
    back = False
    for j in range(work.current.size):
        switched = work.direction[j] != state.direction[j]
        if switched and work.current[j] * work.direction[j] <= 0.0:
            work.direction[j] = state.direction[j]
            back = True
    return back


@njit
def commit(packed, state, work, dt):
    """Make the tried end of the step the state of all cells."""
    for j in range(state.soc.size):
        commit_cell(packed, state, work, j, dt)
