"""One internal step of cells in parallel: voltages, branch currents, new states.

Within a step the current runs straight from its old value to the one tried, and every parameter is
held; so each exponential is followed exactly. A step of no length is an edge: only the current
changes. `packed`, `kept`, `room` are Pack, State and Work of `parameters`; j is the cell's number.

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


def _sources() -> str:
    """Hash of all that is compiled: numba's own cache does not see edits in imported modules."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def _folder() -> Path | None:
    """Where machine code is kept between runs, if it may be."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(home) / "virtual_lab" / _sources()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder


def _compiler():
    """Decorator for functions on arrays and numbers."""
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
    """Value of an even table over 0 … 1; beyond its ends what it is there."""
    last = table.size - 1
    x = min(max(soc, 0.0), 1.0) * last
    k = min(int(x), last - 1)
    return table[k] + (x - k) * (table[k + 1] - table[k])


@njit
def smooth(table, slopes, soc):
    """Value and slope of an even table over 0 … 1 with slopes; beyond its ends it runs straight."""
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
def around(packed, j, second):
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
def stored(packed, j, ampere):
    """Current [A] that changes the state of charge, of a current through the cell [A]."""
    return ampere * packed.efficiency[j] if ampere > 0.0 else ampere


@njit
def ohmic(packed, room, j, ampere):
    """Voltage over the ohmic element, and its slope [ohm]; ampere: through the cell."""
    r = room.r0[j] * (1.0 + packed.asymmetry[j]) if ampere > 0.0 else room.r0[j]
    share, scale = packed.kinetic_share[j], packed.kinetic_volt[j]
    if scale == 0.0:
        return r * ampere, r
    x = share * r * ampere / scale
    volt = (1.0 - share) * r * ampere + scale * math.asinh(x)
    return volt, (1.0 - share) * r + share * r / math.sqrt(1.0 + x * x)


@njit
def warm(packed, kept, room, j, second, dt):
    """Core and hidden rise at the end of a step.

    The ohmic heat is the mean along the straight current (Simpson's rule), with the resistance of
    the step before; the rest of the heat is held.
    """
    before, after = kept.current[j] - packed.leak[j], room.current[j] - packed.leak[j]
    middle = 0.5 * (before + after)
    heat = before * ohmic(packed, room, j, before)[0] + after * ohmic(packed, room, j, after)[0]
    heat = (heat + 4.0 * middle * ohmic(packed, room, j, middle)[0]) / 6.0 + kept.heat[j]
    if packed.heat_capacity[j] == 0.0:
        room.core[j] = around(packed, j, second)
    else:
        resistance = packed.core_resistance[j] + packed.surface_resistance[j]
        decay = math.exp(-dt / (packed.heat_capacity[j] * resistance))
        end = around(packed, j, second - 0.5 * dt) + resistance * heat
        room.core[j] = end + (kept.core[j] - end) * decay
    if packed.rise_tau[j] > 0.0:
        end = packed.rise_resistance[j] * heat
        room.rise[j] = end + (kept.rise[j] - end) * math.exp(-dt / packed.rise_tau[j])
    else:
        room.rise[j] = packed.rise_resistance[j] * heat


@njit
def _acclimatise(packed, room, j, celsius):
    """Parameters at a temperature; all resistances feel the rise by an energy of its own, too."""
    room.celsius[j] = celsius
    risen = arrhenius(packed.rise_energy[j], REFERENCE_CELSIUS + room.rise[j])
    room.r0_warm[j] = risen * packed.r0[j] * arrhenius(packed.r0_energy[j], celsius)
    for e in range(packed.r.shape[1]):
        room.r_warm[j, e] = risen * packed.r[j, e] * arrhenius(packed.r_energy[j, e], celsius)
        room.tau[j, e] = packed.tau[j, e] * arrhenius(packed.tau_energy[j, e], celsius)


@njit
def _decay(packed, room, j, dt):
    """How much of each exponential is left after a step, and what straight currents add."""
    room.second[j] = dt
    for e in range(packed.r.shape[1]):
        x = dt / room.tau[j, e]
        gone = -math.expm1(-x)
        # gone / x loses digits for small x, where the series is exact enough.
        held = 1.0 - gone / x if x > 1e-4 else 0.5 * x - x * x / 6.0
        room.decay[j, e] = 1.0 - gone
        room.new[j, e] = held
        room.old[j, e] = gone - held


@njit
def _factor(packed, j, e, soc):
    if packed.flat[j, e]:
        return packed.factor[j, e, 0]
    return straight(packed.factor[j, e], soc)


@njit
def freeze(packed, kept, room, j, second, dt):
    """Hold the parameters of a step: at its mean charge, the ohmic ones at its end.

    The current that is expected at the end stands in `room.current`.
    """
    celsius = room.core[j] + room.rise[j]
    if celsius != room.celsius[j]:
        _acclimatise(packed, room, j, celsius)
        room.second[j] = -1.0
    if dt != room.second[j]:
        _decay(packed, room, j, dt)
    # The chamber's temperature, not the core's: a cell that warms itself must not gain charge.
    warmer = around(packed, j, second) - REFERENCE_CELSIUS
    room.coulomb[j] = packed.coulomb[j] + packed.coulomb_per_kelvin[j] * warmer
    before = kept.current[j] - packed.leak[j]
    flow = stored(packed, j, before) + stored(packed, j, room.current[j] - packed.leak[j])
    half = 0.25 * dt * flow / room.coulomb[j]
    drift = 1.0 + packed.drift_per_second[j] * second
    room.r0[j] = room.r0_warm[j] * drift * _factor(packed, j, 0, kept.soc[j] + 2.0 * half)
    room.kept[j] = 0.0
    room.gain[j] = 0.0
    for e in range(packed.r.shape[1]):
        r = room.r_warm[j, e] * _factor(packed, j, e + 1, kept.soc[j] + half)
        room.r[j, e] = r
        room.kept[j] += room.decay[j, e] * kept.element[j, e] + r * room.old[j, e] * before
        room.gain[j] += r * room.new[j, e]


@njit
def moved(packed, kept, room, j, dt, ampere):
    """State of charge and h at the end of a step, for a current tried; the slope of dsoc/dA."""
    before, after = kept.current[j] - packed.leak[j], ampere - packed.leak[j]
    per_ampere = 0.5 * dt / room.coulomb[j]
    passed = per_ampere * (stored(packed, j, before) + stored(packed, j, after))
    target = 1.0 if passed > 0.0 else -1.0
    left = math.exp(-packed.hysteresis_per_soc[j] * abs(passed))
    return kept.soc[j] + passed, target + (kept.hysteresis[j] - target) * left, per_ampere


@njit
def terminal(packed, kept, room, j, dt, ampere):
    """Voltage behind the wire at the end of a step, for a current tried, and its slope [ohm]."""
    soc, h, per_ampere = moved(packed, kept, room, j, dt, ampere)
    volt, slope = smooth(packed.ocv[j], packed.ocv_slope[j], soc)
    if room.core[j] != REFERENCE_CELSIUS:
        volt += straight(packed.entropic[j], soc) * (room.core[j] - REFERENCE_CELSIUS)
    lost, resistance = ohmic(packed, room, j, ampere - packed.leak[j])
    through = ampere - packed.leak[j]
    volt += room.kept[j] + room.gain[j] * through + lost + packed.wire[j] * ampere
    volt += packed.hysteresis[j] * h + packed.instant[j] * room.direction[j]
    left = 1.0 - h if soc > kept.soc[j] else 1.0 + h
    turn = packed.hysteresis[j] * packed.hysteresis_per_soc[j] * left
    slope = (max(slope, 0.0) + turn) * per_ampere
    return volt, slope + resistance + room.gain[j] + packed.wire[j]


@njit
def accept(packed, kept, room, j, dt):
    """What was tried becomes what the cell remembers; its heat without the ohmic element's.

    A current I gives I·(V - U) + I·T·dU/dT, counted positive on charge. The voltage over an
    exponential heats by v²/r: what I·v is more or less goes to, or comes from, its capacity.
    """
    ampere = room.current[j]
    before, after = kept.current[j] - packed.leak[j], ampere - packed.leak[j]
    soc, h, _ = moved(packed, kept, room, j, dt, ampere)
    kelvin = ZERO_CELSIUS_KELVIN + room.core[j]
    heat = after * kelvin * straight(packed.entropic[j], soc)
    heat += after * (packed.hysteresis[j] * h + packed.instant[j] * room.direction[j])
    for e in range(packed.r.shape[1]):
        r = room.r[j, e]
        volt = room.decay[j, e] * kept.element[j, e]
        volt += r * (room.old[j, e] * before + room.new[j, e] * after)
        kept.element[j, e] = volt
        heat += volt * volt / r if r > 0.0 else 0.0
    kept.soc[j], kept.hysteresis[j] = soc, h
    kept.core[j], kept.rise[j] = room.core[j], room.rise[j]
    kept.direction[j], kept.current[j], kept.heat[j] = room.direction[j], ampere, heat


@njit
def unrest(packed, kept, room, j):
    """The part of the voltage that does not follow the current at once [V], and its rate [V/s]."""
    through = kept.current[j] - packed.leak[j]
    flow = stored(packed, j, through) / room.coulomb[j]
    volt, slope = smooth(packed.ocv[j], packed.ocv_slope[j], kept.soc[j])
    rate = slope * flow
    for e in range(packed.r.shape[1]):
        volt += kept.element[j, e]
        rate += (room.r[j, e] * through - kept.element[j, e]) / room.tau[j, e]
    target = 1.0 if flow > 0.0 else -1.0
    h = kept.hysteresis[j]
    volt += packed.hysteresis[j] * h
    rate += packed.hysteresis[j] * packed.hysteresis_per_soc[j] * abs(flow) * (target - h)
    return volt, rate


MOST = 120
UNDAMPED = 20
CLOSE_AMPERE = 1e-11


@njit
def advance(packed, kept, room, second, dt, hold, target):
    """Try one internal step that ends at `second` of the test.

    The group's current becomes `target` [A], or, where `hold` is set, its voltage [V]. Gives that
    voltage; what the cells would remember stands in `room`. NaN: no currents were found.
    """
    n = kept.soc.size
    extra = 0.0 if hold else (target - kept.current.sum()) / n
    for j in range(n):
        room.direction[j] = kept.direction[j]
        room.current[j] = kept.current[j] + extra
        warm(packed, kept, room, j, second, dt)
        freeze(packed, kept, room, j, second, dt)
    volt = _settle(packed, kept, room, dt, hold, target)
    if _turned(packed, room):
        volt = _settle(packed, kept, room, dt, hold, target)
        if _turned_back(kept, room):
            volt = _settle(packed, kept, room, dt, hold, target)
    return volt


@njit
def _settle(packed, kept, room, dt, hold, target):
    """Find the currents; gives the common voltage."""
    if kept.soc.size == 1 and not hold:
        room.current[0] = target
        return terminal(packed, kept, room, 0, dt, target)[0]
    for k in range(MOST):
        # Kinks (asymmetry) and steep kinetics can send Newton's method round in a circle.
        damping = 1.0 if k < UNDAMPED else 0.5
        change, common = _newton(packed, kept, room, dt, hold, target, damping)
        if change < CLOSE_AMPERE:
            return common
    return math.nan


@njit
def _newton(packed, kept, room, dt, hold, target, damping):
    """One improvement of all currents; gives the largest change [A] and the common voltage."""
    n = kept.soc.size
    conductance, weighted, flowing = 0.0, 0.0, 0.0
    for j in range(n):
        room.volt[j], room.slope[j] = terminal(packed, kept, room, j, dt, room.current[j])
        conductance += 1.0 / room.slope[j]
        weighted += room.volt[j] / room.slope[j]
        flowing += room.current[j]
    common = target if hold else (target - flowing + weighted) / conductance
    most = 0.0
    for j in range(n):
        change = (common - room.volt[j]) / room.slope[j]
        room.current[j] += damping * change
        most = max(most, abs(change) / (1.0 + abs(room.current[j])))
    return most, common


@njit
def _turned(packed, room):
    """Whether a current large enough to count has changed its sign; the sign is set anew."""
    turned = False
    for j in range(room.current.size):
        sign = 1.0 if room.current[j] > 0.0 else -1.0
        counts = abs(room.current[j]) > packed.threshold[j] and packed.instant[j] != 0.0
        if counts and sign != room.direction[j]:
            room.direction[j] = sign
            turned = True
    return turned


@njit
def _turned_back(kept, room):
    """Whether a cell's jump of voltage turned its own current back; such a jump is not made.

    Beside other cells it would be made and undone for ever, as by a relay without a dead band.
    """
    back = False
    for j in range(room.current.size):
        turned = room.direction[j] != kept.direction[j]
        if turned and room.current[j] * room.direction[j] <= 0.0:
            room.direction[j] = kept.direction[j]
            back = True
    return back


@njit
def take(packed, kept, room, dt):
    """The step tried is made."""
    for j in range(kept.soc.size):
        accept(packed, kept, room, j, dt)
