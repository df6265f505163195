"""A cell as one particle with charge transfer at its surface: one set of numbers for all
temperatures, and the derivative of its voltage by each of them.

1. The SoC is the stoichiometry of one sphere. What flows in or out at its surface evens out by
   diffusion, whose rate D/R² depends on the local SoC: z is that of its shells, and z_s at the
   surface.
2. Charge transfer there has a capacitance beside it: C·du/dt = I − (s/R)·sinh(u/s), s = n·RT/F, R
   over z_s. So a weak cold load polarises slowly, which no fixed time constant shows. Each third of
   a step is solved exactly for one current and the resistance in its middle.
3. Two linear lags, w' = (I − w)/τ, stand for the electrolyte and the other electrode.
4. What an electrode shows after a charge and after a discharge differs by 2·M(z_s): a hysteresis
   whose small loops close, of state h between −1 and 1.
5. V = OCV(z_s) + shift(z_s) + entropy(z_s)·(T − 25 °C) + M(z_s)·h + R0(z_s)·I + u + Σ R(z_s)·w.

Rates and resistances follow Arrhenius laws; those of resistances may bend: what is straight from 45
to −5 °C is not at −25 °C.

Sources: diffusion J. Crank, The Mathematics of Diffusion (1975), ch. 6; finite volumes Y. Zeng et
al., J. Electrochem. Soc. 160 (2013) A1565; two implicit stages R. Alexander, SIAM J. Numer. Anal.
14 (1977) 1006; charge transfer with a double layer J. Newman, K. Thomas-Alyea, Electrochemical
Systems (2004), ch. 8 and 22.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import ocv_and_slope
from cellwright.circuits.temperature import table_soc, temperature_weights
from cellwright.native import array, count, function, real
from cellwright.numerics.clock import checked_columns
from cellwright.numerics.hysteresis import STOPS, WIDTHS, preisach
from cellwright.numerics.lags import lag_weights
from cellwright.numerics.lines import FARADAY, GAS_CONSTANT, ZERO_CELSIUS_KELVIN
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal

NAME = "P"  # of the member, beside those of circuits
SHELLS = 14
FINER_OUTSIDE = 1.6  # power that makes the shells thinner towards the surface
LONGEST_SECOND = 30.0  # of one implicit step of the diffusion
COUNTED_SECOND = 0.5  # of a step, in which a counter tells the charge better than two currents do
REFERENCE_KELVIN = REFERENCE_CELSIUS + ZERO_CELSIUS_KELVIN
COLD_KELVIN = 248.15  # −25 °C, at which the bend of an Arrhenius line is stated
BEND_REFERENCE = 1.0 / COLD_KELVIN - 1.0 / REFERENCE_KELVIN  # 1/K
TRANSFER_PARTS = 3  # of a step, in each of which charge transfer sees one current
STAGE = 1.0 - 0.5**0.5  # of a step of the diffusion, in either of two that make one second order
NEARLY_NONE = 1e-3  # below which a series serves

NEAR_EMPTY = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0)
OHMIC = (0.0, 0.1, 0.5, 1.0)
RELAXING = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0)
OPEN = (0, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
ENTROPIC = (0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
TURNING = (0.0, 0.1, 0.3, 0.7, 1.0)
# ASSUME: A hysteresis goes from one branch to the other within some three charges of this share of
# the capacity. Cells of iron phosphate and of silicon in graphite fit equally well with 1 to 8 %.
TURN_SHARE = 0.03


class Part(NamedTuple):
    """A parameter: its name, the SoC of its knots (none: one number for all), its unit, whether
    its logarithm is what a fit moves."""

    name: str
    knots: tuple
    unit: str
    logarithmic: bool


def _resistance(name, knots):
    """Parts of a resistance: over SoC, its activation energy, and how that bends in the cold."""
    return (
        Part(f"{name}_ohm", knots, "Ohm", True),
        Part(f"{name}_joule_per_mole", (), "J/mol", False),
        Part(f"{name}_bend_joule_per_mole", (), "J/mol", False),
    )


def _lag(name):
    return (
        *_resistance(name, RELAXING),
        Part(f"{name}_second", (), "s", True),
        Part(f"{name}_second_joule_per_mole", (), "J/mol", False),
    )


# In the order of the kernel's derivatives, as far as it makes them.
PARTS = (
    Part("diffusion_per_second", NEAR_EMPTY, "1/s", True),
    Part("diffusion_joule_per_mole", (), "J/mol", False),
    *_resistance("transfer", NEAR_EMPTY),
    Part("double_layer_farad", (), "F", True),
    Part("double_layer_joule_per_mole", (), "J/mol", False),
    Part("transfer_scale", (), "1", True),
    *_resistance("r0", OHMIC),
    *_lag("fast"),
    *_lag("slow"),
    Part("ocv_shift_volt", OPEN, "V", False),
    Part("ocv_volt_per_kelvin", ENTROPIC, "V/K", False),
    Part("hysteresis_volt", TURNING, "V", False),
)
LAGS = ("fast", "slow")
SCALES = ("missing", "stretch")  # one each a temperature: how the OCV lies on the counted SoC


class Particle(NamedTuple):
    """A cell as a particle.

    ocv_volt : (201,) on an even grid of SoC [V]. celsius : (c,) temperatures at which the OCV's
    place on the counted SoC was found, ascending [degC]. vector : (p,) all parameters as a fit
    moves them, see `layout`.
    """

    ocv_volt: np.ndarray
    celsius: np.ndarray
    vector: np.ndarray


class Run(NamedTuple):
    """A simulated record.

    voltage_volt, ocv_volt, surface_soc : (n,) [V], [V], [1]; the OCV is that of the surface.
    overpotential_volt : (4, n) of charge transfer, ohmic resistance, and the two lags [V].
    by : (n, p) derivative of the voltage by each number of the vector, None where not asked for.
    """

    voltage_volt: np.ndarray
    ocv_volt: np.ndarray
    surface_soc: np.ndarray
    overpotential_volt: np.ndarray
    by: np.ndarray | None


def layout(temperatures):
    """Where each parameter lies in the vector of a particle.

    Parameters
    ----------
    temperatures : how many the SoC's scale is known at.

    Returns
    -------
    places : dict name → slice.
    """
    sizes = [(part.name, max(len(part.knots), 1)) for part in PARTS]
    sizes += [(name, temperatures) for name in SCALES]
    ends = np.cumsum([size for _, size in sizes])
    return {name: slice(end - size, end) for (name, size), end in zip(sizes, ends, strict=True)}


def to_document(particle, std=None):
    """A particle as it stands in a model file: lists and numbers, in the units of their names.

    Parameters
    ----------
    particle : Particle. std : (p,) standard deviations of its vector, or None.
    """
    places = layout(len(particle.celsius))
    document = {"ocv_volt": particle.ocv_volt.tolist(), "celsius": particle.celsius.tolist()}
    logarithmic = {part.name: part.logarithmic for part in PARTS}
    for name, place in places.items():
        value = particle.vector[place]
        value = np.exp(value) if logarithmic.get(name) else value
        document[name] = value.tolist()
        if std is not None:
            deviation = std[place] * (value if logarithmic.get(name) else 1.0)
            document[f"{name}_std"] = deviation.tolist()
    return document


def of_document(document):
    """Particle of a model file.

    Parameters
    ----------
    document : dict, as `to_document` makes it.

    Raises
    ------
    Refusal : a parameter is missing, has another number of values, or is not positive where it
        has to be.
    """
    celsius = np.asarray(document["celsius"], float)
    places, vector = layout(len(celsius)), []
    logarithmic = {part.name: part.logarithmic for part in PARTS}
    for name, place in places.items():
        size = place.stop - place.start
        value = np.atleast_1d(np.asarray(document.get(name, ()), float))
        sound = len(value) == size and np.isfinite(value).all()
        if not sound or (logarithmic.get(name) and not (value > 0).all()):
            kind = "positive numbers" if logarithmic.get(name) else "numbers"
            found = f"{name} of the particle is {document.get(name)}"
            raise Refusal(f"{found}; wanted {size} {kind}")
        vector.append(np.log(value) if logarithmic.get(name) else value)
    ocv_volt = np.asarray(document["ocv_volt"], float)
    return Particle(ocv_volt, celsius, np.concatenate(vector))


def run(
    particle,
    test_time_second,
    current_ampere,
    soc,
    celsius,
    *,
    capacity_ampere_hour,
    derivatives=False,
):
    """Simulate a particle that starts from rest through a record.

    Parameters
    ----------
    particle : Particle.
    test_time_second : (n,) never falling [s]. current_ampere : (n,) positive on charge [A].
    soc : (n,) as counted; where it is not finite the current alone tells the charge [1].
    celsius : scalar or (n,) temperature of the cell [degC].
    capacity_ampere_hour : what the SoC refers to [Ah].
    derivatives : whether they are made.

    Returns
    -------
    run : Run.

    Raises
    ------
    Refusal : no row, time that runs back, values that are not finite.
    """
    time, current = checked_columns({"time": test_time_second, "current": current_ampere})
    celsius = np.ascontiguousarray(np.broadcast_to(celsius, time.shape), float)
    if not np.isfinite(celsius).all():
        raise Refusal(f"{np.sum(~np.isfinite(celsius))} temperatures are not known; wanted all")
    places = layout(len(particle.celsius))
    at = {name: particle.vector[place] for name, place in places.items()}
    step = np.diff(time, prepend=time[0])
    mean = np.append(0.0, (current[1:] + current[:-1]) / 2)
    counted = _counted_ampere(step, mean, np.asarray(soc, float), capacity_ampere_hour)
    # ASSUME: How the OCV lies on the counted SoC is a matter of the record's mean temperature.
    weights = np.array(temperature_weights(particle.celsius, np.array([celsius.mean()])))[:, 0]
    stretch = float(weights @ at["stretch"])
    start = float(table_soc(soc[0], float(weights @ at["missing"]), stretch))
    flux = (1.0 + stretch) / (3.0 * 3600.0 * capacity_ampere_hour)
    kernel = _kernel_parameters(at, start, flux)
    states = _states((step, current, counted, celsius), kernel, derivatives)
    # ASSUME: A record begins half-way between the branches of the hysteresis.
    turned = counted * step / (3600.0 * capacity_ampere_hour * TURN_SHARE)
    direction = preisach(turned, np.zeros(len(time)), np.eye(1, len(time))[0])
    terms = _terms(particle.ocv_volt, at, states, (current, celsius, direction))
    over = np.array([states.transfer_volt, *(terms[name].volt for name in ("r0", *LAGS))])
    volt = terms["ocv"].volt + over.sum(axis=0)
    by = None
    if derivatives:
        by = _derivatives(places, terms, states, weights, stretch, soc[0])
    return Run(volt, terms["ocv"].volt, states.surface_soc, over, by)


class _States(NamedTuple):
    """States of a record (n,) and their derivatives by the parameters of the kernel.

    surface_soc [1]. transfer_volt [V]. lagged_ampere : (n, lags) [A]. surface_by : (n, m) by those
    that move the particle. transfer_by : (n, a) by all of it. lagged_by : (n, lags, 2) by ln time
    constant and its energy. The last three are empty where they are not asked for.
    """

    surface_soc: np.ndarray
    transfer_volt: np.ndarray
    lagged_ampere: np.ndarray
    surface_by: np.ndarray
    transfer_by: np.ndarray
    lagged_by: np.ndarray


class _Term(NamedTuple):
    """Part of the voltage (n,) [V], its derivative by the surface's SoC (n,) [V], and by parameters
    of its own: dict name → (n,) or (n, knots)."""

    volt: np.ndarray
    by_surface: np.ndarray
    own: dict


def _counted_ampere(step, mean, soc, capacity):
    """Mean current of each step (n,) by the counter where it resolves one [A]."""
    passed = np.diff(soc, prepend=soc[0]) * 3600.0 * capacity
    by_counter = np.divide(passed, step, out=mean.copy(), where=step >= COUNTED_SECOND)
    return np.where(np.isfinite(by_counter), by_counter, mean)


def _kernel_parameters(at, start, flux):
    """Start and flux, then what the kernel makes derivatives by, and of its lags (lags, 2)."""
    names = [part.name for part in PARTS]
    moved = names[: names.index("transfer_scale") + 1]
    lags = [[*at[f"{name}_second"], *at[f"{name}_second_joule_per_mole"]] for name in LAGS]
    return np.concatenate([[start, flux], *(at[name] for name in moved)]), np.array(lags)


def _course(values, knots, soc):
    """A course over SoC, linear between knots and flat beyond: it, its slope, and at each row the
    knot below and the weights (n, 2) of it and the next one."""
    knots = np.asarray(knots, float)
    below = np.clip(np.searchsorted(knots, soc, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((soc - knots[below]) / (knots[below + 1] - knots[below]), 0.0, 1.0)
    slopes = np.diff(values) / np.diff(knots)
    inside = (soc > knots[0]) & (soc < knots[-1])
    course = values[below] + share * (values[below + 1] - values[below])
    return course, np.where(inside, slopes[below], 0.0), _Hats(below, share, len(knots))


class _Hats(NamedTuple):
    """Columns of a course over SoC: the knot below each row, the share of the next, how many."""

    below: np.ndarray
    share: np.ndarray
    knots: int

    def times(self, factor):
        """The columns (n, knots), each row times a factor (n,)."""
        rows, columns = np.arange(len(self.below)), np.zeros((len(self.below), self.knots))
        columns[rows, self.below] = (1.0 - self.share) * factor
        columns[rows, self.below + 1] = self.share * factor
        return columns


def _terms(ocv_volt, at, states, columns):
    """Each part of the voltage but charge transfer, by its name: dict of _Term.

    Parameters
    ----------
    ocv_volt : of Particle. at : dict of its parameters. states : _States.
    columns : current [A], temperature [degC] and state of the hysteresis (n,) of each row.
    """
    current, celsius, direction = columns
    soc, warmer = states.surface_soc, celsius - REFERENCE_CELSIUS
    warmth = 1.0 / (celsius + ZERO_CELSIUS_KELVIN) - 1.0 / REFERENCE_KELVIN
    bent = warmth**2 / BEND_REFERENCE
    volt, slope = ocv_and_slope(ocv_volt, soc)
    shift, shift_slope, of_shift = _course(at["ocv_shift_volt"], OPEN, soc)
    per_kelvin, kelvin_slope, of_kelvin = _course(at["ocv_volt_per_kelvin"], ENTROPIC, soc)
    half_gap, gap_slope, of_gap = _course(at["hysteresis_volt"], TURNING, soc)
    wanted = states.lagged_by.size > 0
    own = {"ocv_shift_volt": (of_shift, 1.0), "ocv_volt_per_kelvin": (of_kelvin, warmer)}
    own["hysteresis_volt"] = (of_gap, direction)
    volt = volt + shift + warmer * per_kelvin + direction * half_gap
    slopes = slope + shift_slope + warmer * kelvin_slope + direction * gap_slope
    terms = {"ocv": _Term(volt, slopes, _columns(own, wanted))}
    through = {"r0": (current, OHMIC)}
    through |= {name: (states.lagged_ampere[:, k], RELAXING) for k, name in enumerate(LAGS)}
    for name, (ampere, knots) in through.items():
        log_ohm, log_slope, hats = _course(at[f"{name}_ohm"], knots, soc)
        energy, bend = at[f"{name}_joule_per_mole"], at[f"{name}_bend_joule_per_mole"]
        ohm = np.exp(log_ohm + (energy * warmth + bend * bent) / GAS_CONSTANT)
        over = ohm * ampere
        own = _columns({f"{name}_ohm": (hats, over)}, wanted)
        if wanted:
            own[f"{name}_joule_per_mole"] = over * warmth / GAS_CONSTANT
            own[f"{name}_bend_joule_per_mole"] = over * bent / GAS_CONSTANT
        if wanted and name in LAGS:
            by_log, by_energy = (ohm[:, None] * states.lagged_by[:, LAGS.index(name)]).T
            own |= {f"{name}_second": by_log, f"{name}_second_joule_per_mole": by_energy}
        terms[name] = _Term(over, over * log_slope, own)
    return terms


def _columns(courses, wanted):
    """Columns of courses over SoC, each times a factor; none where they are not wanted."""
    return {name: hats.times(factor) for name, (hats, factor) in courses.items() if wanted}


def _derivatives(places, terms, states, weights, stretch, first_soc):
    """Derivative of the voltage (n, p) by each number of the vector."""
    rows = len(states.surface_soc)
    by = np.zeros((rows, max(place.stop for place in places.values())))
    for term in terms.values():
        for name, columns in term.own.items():
            by[:, places[name]] = columns.reshape(rows, -1)
    by_surface = sum(term.by_surface for term in terms.values())
    kernel = states.transfer_by.copy()
    kernel[:, : states.surface_by.shape[1]] += by_surface[:, None] * states.surface_by
    # Its first two, start and flux, follow from the scale of the SoC; the others begin the vector.
    by[:, : kernel.shape[1] - 2] = kernel[:, 2:]
    by_start, by_flux = kernel[:, 0], kernel[:, 1]
    by[:, places["missing"]] = -np.outer(by_start, weights)
    stretched = by_flux / (1.0 + stretch) - (1.0 - first_soc) * by_start
    by[:, places["stretch"]] = np.outer(stretched, weights)
    return by


def shell_faces():
    """Radii of the shells' faces from the middle of a sphere of radius 1 to its surface."""
    return 1.0 - (1.0 - np.arange(SHELLS + 1) / SHELLS) ** FINER_OUTSIDE


def _shells():
    """Volume of each shell, what its outer face conducts, and the way from the last middle to the
    surface; of a sphere of radius and diffusivity 1."""
    face = shell_faces()
    middle = (face[1:] + face[:-1]) / 2
    conductance = np.append(face[1:-1] ** 2 / np.diff(middle), 0.0)
    return np.diff(face**3) / 3.0, conductance, 1.0 - middle[-1]


def _states(columns, parameters, derivatives):
    """States of a record, in C where that can be built.

    Parameters
    ----------
    columns : step, current, counted current, celsius (n,) of each row.
    parameters : from `_kernel_parameters`. derivatives : whether they are made.
    """
    vector, lags = parameters
    knots = np.array(NEAR_EMPTY)
    rows, moving = len(columns[0]), len(knots) + 3
    whole = moving + len(knots) + 5
    sizes = (moving, whole) if derivatives else (0, 0)
    states = _States(
        np.empty(rows),
        np.empty(rows),
        np.empty((rows, len(lags))),
        *(np.empty((rows, size)) for size in sizes),
        np.empty((rows, len(lags), 2) if derivatives else (0, 0, 0)),
    )
    sphere = (SHELLS, *_shells(), LONGEST_SECOND, REFERENCE_KELVIN, BEND_REFERENCE)
    courses = (len(knots), knots, vector, len(lags), lags)
    kernel = _kernel()
    if kernel is None:
        return _twin(columns, vector, lags, states, derivatives)
    columns = [np.ascontiguousarray(column, float) for column in columns]
    kernel(rows, *columns, *sphere, *courses, derivatives, *states)
    return states


def kernel_arrays(particle):
    """A particle as a step of it in C reads it, see native/particle.c.

    Parameters
    ----------
    particle : Particle.

    Returns
    -------
    arrays : dict, name → array of float: `sizes` (shells, lags, stops of the hysteresis, knots of
        each course, points of the OCV), `sphere`, `knots`, `vector`, `ocv_volt`.
    """
    courses = NEAR_EMPTY, OHMIC, RELAXING, OPEN, ENTROPIC, TURNING
    volume, conductance, to_surface = _shells()
    numbers = [to_surface, LONGEST_SECOND, REFERENCE_KELVIN, BEND_REFERENCE]
    sizes = [SHELLS, len(LAGS), STOPS, *map(len, courses), len(particle.ocv_volt)]
    return {
        "sizes": np.array(sizes, float),
        "sphere": np.concatenate([volume, conductance, 1.0 / (WIDTHS * TURN_SHARE), numbers]),
        "knots": np.concatenate(courses).astype(float),
        "vector": particle.vector,
        "ocv_volt": particle.ocv_volt,
    }


def compiled():
    """Whether the kernel can be built: by its twin a fit would take minutes for seconds."""
    return _kernel() is not None


def _kernel():
    types = (count, *[array] * 4, count, array, array, *[real] * 4)
    types += (count, array, array, count, array, count, *[array] * 6)
    return function("particle", *types)


def _twin(columns, vector, lags, states, derivatives):
    """What native/particle.c says, in numpy: `states`, filled."""
    knots, sphere = np.array(NEAR_EMPTY), _shells()
    rates = len(knots)
    moving = rates + 3
    whole, flux = moving + rates + 5, vector[1]
    ln_transfer, (energy, bend, ln_farad, farad_energy, ln_scale) = (
        vector[moving : moving + rates],
        vector[moving + rates :],
    )
    z, z_by = np.full(SHELLS, vector[0]), np.zeros((SHELLS, moving))
    z_by[:, 0] = 1.0
    before = z, z_by, np.inf
    u, u_by, log_ohm, log_by = 0.0, np.zeros(whole), 0.0, np.zeros(whole)
    w, w_by = np.zeros(len(lags)), np.zeros((len(lags), 2))
    for k, (second, now, counted, celsius) in enumerate(zip(*columns, strict=True)):
        kelvin = celsius + ZERO_CELSIUS_KELVIN
        warmth = 1.0 / kelvin - 1.0 / REFERENCE_KELVIN
        second = second if k else 0.0
        parts = int(np.ceil(second / LONGEST_SECOND))
        for _ in range(parts):
            part = second / parts
            ahead = 0.5 * min(part / before[2], 1.0)
            soc, soc_by = z + ahead * (z - before[0]), z_by + ahead * (z_by - before[1])
            rate, rate_by = _rate(vector, knots, soc, soc_by, warmth)
            before = z, z_by, part
            z, z_by = _diffused(z, z_by, rate, rate_by, sphere, part, counted * flux)
        (rate,), (rate_by,) = _rate(vector, knots, z[-1:], z_by[-1:], warmth)
        lead = now * flux / rate * sphere[2]
        surface, surface_by = z[-1] + lead, z_by[-1] - lead / rate * rate_by
        surface_by[1] += lead
        (log,), (slope,), hat = _course(ln_transfer, knots, np.array([surface]))
        bent = warmth**2 / BEND_REFERENCE
        log_before, log_before_by = log_ohm, log_by
        log_ohm = log + (energy * warmth + bend * bent) / GAS_CONSTANT
        own = [*hat.times(1.0)[0], warmth / GAS_CONSTANT, bent / GAS_CONSTANT, 0.0, 0.0, 0.0]
        log_by = np.concatenate([slope * surface_by, own])
        if second > 0:
            currents = columns[1][k - 1], now
            ratio = second / np.exp(lags[:, 0] + lags[:, 1] * warmth / GAS_CONSTANT)
            decay, w, by_ratio = _lag_ended(ratio, w, *currents)
            by_log = -ratio * by_ratio
            by = np.column_stack([by_log, by_log * warmth / GAS_CONSTANT])
            w_by = decay[:, None] * w_by + by
            farad = np.exp(ln_farad + farad_energy * warmth / GAS_CONSTANT)
            scale = np.exp(ln_scale) * GAS_CONSTANT * kelvin / FARADAY
            u, decay, (by_begin, by_end, by_log_farad, by_log_scale) = _transferred(
                u, second, currents, (log_before, log_ohm), farad, scale
            )
            u_by = decay * u_by + by_begin * log_before_by + by_end * log_by
            u_by[-3:] += [by_log_farad, by_log_farad * warmth / GAS_CONSTANT, by_log_scale]
        states.surface_soc[k], states.transfer_volt[k], states.lagged_ampere[k] = surface, u, w
        if derivatives:
            states.surface_by[k], states.transfer_by[k] = surface_by, u_by
            states.lagged_by[k] = w_by
    return states


def _rate(vector, knots, soc, soc_by, warmth):
    """Rate of diffusion at some SoC (m,) [1/s], and its derivatives (m, moving)."""
    rates = len(knots)
    log, slope, hat = _course(vector[2 : 2 + rates], knots, soc)
    rate = np.exp(log - vector[2 + rates] * warmth / GAS_CONSTANT)
    rate_by = (rate * slope)[:, None] * soc_by
    rate_by[:, 2 : 2 + rates] += hat.times(rate)
    rate_by[:, 2 + rates] -= rate * warmth / GAS_CONSTANT
    return rate, rate_by


def _diffused(z, z_by, rate, rate_by, sphere, second, flow):
    """SoC of the shells after an implicit step of second order, and its derivatives."""
    volume, conductance, _ = sphere
    sums = rate[:-1] + rate[1:]
    passed = 2.0 * rate[:-1] * rate[1:] / sums * conductance[:-1]
    weight = volume / (STAGE * second)
    matrix = np.diag(weight + np.append(passed, 0.0) + np.append(0.0, passed))
    matrix -= np.diag(passed, 1) + np.diag(passed, -1)
    inner, outer = (2.0 * conductance[:-1] * r**2 / sums**2 for r in (rate[1:], rate[:-1]))
    passed_by = inner[:, None] * rate_by[:-1] + outer[:, None] * rate_by[1:]
    begin, begin_by = z, z_by
    for kept in (0.0, -np.sqrt(2.0)):
        right = weight * ((1.0 - kept) * z + kept * begin)
        right_by = weight[:, None] * ((1.0 - kept) * z_by + kept * begin_by)
        right[-1] += flow
        z = np.linalg.solve(matrix, right)
        change = np.diff(z)[:, None] * passed_by
        right_by[:-1] += change
        right_by[1:] -= change
        right_by[-1, 1] += flow
        z_by = np.linalg.solve(matrix, right_by)
    return z, z_by


def _lag_ended(ratio, begin, first, now):
    """A lag of the current at the end of a step in units of its time constant: what is left of the
    begin, the state, its derivative by the ratio; exact for a current on a straight line."""
    decay, before, after = lag_weights(ratio, 1.0, hold="first_order")
    series = 0.5 - ratio / 3.0 + ratio**2 / 8.0
    by_after = np.where(ratio < NEARLY_NONE, series, (1.0 - decay - ratio * decay) / ratio**2)
    state = decay * begin + before * first + after * now
    return decay, state, (first - begin) * decay + (now - first) * by_after


def _transferred(begin, second, currents, logs, farad, scale):
    """Overvoltage of charge transfer at the end of a step [V], what is left of that at its begin,
    and derivatives by ln resistance at begin and end, ln capacitance and ln scale.

    exp(u/s) under a constant current follows a Riccati equation, solved as it stands: in each part
    of a step the current is the one by which a lag would end as on the straight line.
    """
    first, step = currents[0], (currents[1] - currents[0]) / TRANSFER_PARTS
    y, left, by = np.exp(begin / scale), 1.0, np.array([0.0, 0.0, 0.0, -begin / scale])
    for part in range(TRANSFER_PARTS):
        at = (part + 0.5) / TRANSFER_PARTS
        ohm = np.exp(logs[0] + at * (logs[1] - logs[0]))
        later = first + step * (part + 1)
        b, base = ohm * later / scale, second / TRANSFER_PARTS / (ohm * farad)
        ratio = base * np.sqrt(1.0 + b**2)
        gained = -np.expm1(-ratio)
        share, by_share = 0.5 + ratio / 12.0, 1.0 / 12.0
        if ratio > NEARLY_NONE:
            share = 1.0 / gained - 1.0 / ratio
            by_share = 1.0 / ratio**2 - (1.0 - gained) / gained**2
        a = ohm * (later + step * (share - 1.0)) / scale
        q = np.sqrt(1.0 + a**2)
        passed = -np.expm1(-q * base)
        t, rest = passed / (2.0 - passed), 2.0 * (1.0 - passed) / (2.0 - passed)
        g, small = t / q, (1.0 / (q + abs(a)) + rest * abs(a)) / q  # 1 - |a| g, of no difference
        above, below = (1.0 + a * g, small) if a >= 0.0 else (small, 1.0 - a * g)
        up, down = above + g / y, below + g * y
        flat = rest * (2.0 - rest)
        decay, far = flat / (up * down), a - 0.5 * (y - 1.0 / y)  # from where it would settle
        of_g = a / q**2 * (0.5 * flat * base - g)
        own = (t / q + a**2 * 0.5 * base * flat) / q**2
        by_a = (own + of_g / y) / up + (own - of_g * y) / down
        by_base, by_turn = decay * far * base, by_a * ohm / scale * step * by_share * ratio
        by_log_ohm = a * by_a - by_base - by_turn / (1.0 + b**2)
        by_log_scale = -a * by_a - by_turn * b**2 / (1.0 + b**2)
        y, left = y * up / down, left * decay
        own_by = (1.0 - at) * by_log_ohm, at * by_log_ohm, -by_base - by_turn, by_log_scale
        by = decay * by + np.array(own_by)
    volt = scale * np.log(y)
    return volt, left, scale * by + np.array([0.0, 0.0, 0.0, volt])
