"""The model of the search: its voltage with effects, and its fit without any.

One function computes the voltage of all records for one vector of parameters, in stages that an
effect may step into: the current through the cell, the counting of charge, the resistances, the
OCV, the overpotentials, the reading. Without effects it is the plain isothermal circuit.
"""

from functools import cache, partial
from math import exp
from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import held_on_grid, ocv_on_grid, usual_slope
from cellwright.circuits.instrument import delayed
from cellwright.numerics.lags import lag_fresh
from cellwright.numerics.least_squares import Free

STAGES = ("current", "counting", "resistance", "diffusion", "ocv", "overpotential", "reading")
OCV_KNOTS = 16
OCV_NAMES = tuple(f"ocv[{k}]" for k in range(OCV_KNOTS))
TAU_SECOND = {"tau1": (2.0, 40.0), "tau2": (40.0, 600.0)}
KEPT_RESPONSES = 40
KEPT_COURSES = 4  # of the SoC, and of the OCV over each
SOC_LIMITS = (-0.5, 1.5)  # of a trial step of the fit, so that nothing overflows
LOGARITHMS = ("log_r0", "log_r1", "log_tau1", "log_r2", "log_tau2")
LOG_STEP, SOC_STEP, VOLT_STEP = 0.01, 2e-4, 1e-3
APART_SECOND = 1e6  # between records, so that they lie on one time axis
LEAD = "lead_ohm"  # of contacts: a resistance without a course over SoC or temperature [ohm]
LOG_STD = {"log_r0": 1.5, "log_r1": 1.5, "log_r2": 1.5, "log_tau1": 0.8, "log_tau2": 0.8}
STEEP = 2.0  # times the usual slope of the OCV
MOST_LEAD = 3.0  # times the ohmic resistance
NONE = np.zeros(0)  # what no stage has set yet
OWN_KNOT = 0.1  # of the tolerance of the OCV: what each knot may err alone


class Fields(NamedTuple):
    """Quantities that the stages pass on and change; scalars or (n,).

    current : through the cell [A]. held : mean of it since the row before [A]. moved : charge
    passed since the row before, + on charge [Ah]. capacity : [Ah]. soc : [1].
    celsius : inside the cell [degC]. r0, r1, r2 : [ohm]. tau1, tau2 : [s]. slow : factors of r1
    and of r2, tau_factor : of tau1 and of tau2, both apart from these so that what follows from
    them is kept while these move [1]. lead : by which the state of charge at the surface of the
    particles, where the OCV is, is ahead of that within, 0.0 or (n,) [1]. exchange_factor : of the
    exchange current, by temperature [1]. ocv : [V].
    ohmic : voltage that follows the current at once [V]. volt : of the terminals, so far [V].
    """

    current: np.ndarray
    held: np.ndarray
    moved: np.ndarray
    capacity: np.ndarray
    soc: np.ndarray
    celsius: np.ndarray
    r0: np.ndarray
    r1: np.ndarray
    r2: np.ndarray
    tau1: float
    tau2: float
    slow: tuple
    tau_factor: np.ndarray | float
    ocv: np.ndarray
    ohmic: np.ndarray
    volt: np.ndarray | float
    lead: np.ndarray | float = 0.0
    exchange_factor: np.ndarray | float = 1.0

    @property
    def slow_ohm(self):
        """Resistances of both RC pairs with their factor: two of (n,) [ohm]."""
        return self.r1 * self.slow[0], self.r2 * self.slow[1]

    @property
    def slow_second(self):
        """Time constants of both RC pairs with their factor: two of (n,), or scalars [s]."""
        return self.tau1 * self.tau_factor, self.tau2 * self.tau_factor


class Cell(NamedTuple):
    """A cell as it is measured before the search: capacity [Ah], OCV table on an even grid [V]."""

    capacity_ampere_hour: float
    ocv_volt: np.ndarray

    def ocv_at(self, soc):
        """OCV [V], beyond the table straight on."""
        return ocv_on_grid(self.ocv_volt, soc)


def base_names(files):
    """Names of the plain model's parameters for so many records.

    Logarithms of resistances and time constants, relative error of the capacity, SoC at the start
    of each record, and the error of the OCV table at evenly spaced knots [V].
    """
    return (*LOGARITHMS, "capacity", *start_names(files), *OCV_NAMES)


@cache
def start_names(files):
    """Names of the SoC at the start of each of so many records."""
    return tuple(f"soc0[{k}]" for k in range(files))


def stated_starts(stack):
    """SoC at the start of each record as stated or counted first [1]: dict by parameter's name."""
    return dict(zip(start_names(len(stack.first)), stack.soc_at_start.tolist(), strict=True))


def voltage(cell, stack, values, effects=()):
    """Voltage of the terminals over all records [V].

    Parameters
    ----------
    cell : Cell. stack : records.Stack.
    values : dict of parameters by name, those of `base_names` and of the effects.
    effects : sequence of Effect.

    Returns
    -------
    volt : (n,) [V].
    """
    return fields_of(cell, stack, values, effects).volt


def fields_of(cell, stack, values, effects=()):
    """Fields of all stages for `voltage`: currents, SoC, resistances, OCV and terminal voltage."""
    staged = {stage: [] for stage in STAGES}
    for effect in effects:
        staged[effect.stage].append(effect)

    def through(stage, fields):
        for effect in staged[stage]:
            fields = effect.act(fields, stack, effect.sizes_of(values))
        return fields

    def counted():
        fields = through("current", _begun(cell, stack, values))
        moved = fields.held * (stack.step_second / 3600.0) + stack.unseen_ampere_hour
        return _counted(stack, values, through("counting", fields._replace(moved=moved)))

    course = _course(cell, stack, values, staged["current"] + staged["counting"], counted)
    fields = through("diffusion", through("resistance", course.fields))
    ocv = _open_circuit(cell, values, fields.soc, course)
    fields = through("ocv", fields._replace(ocv=_at_surface(cell, stack, fields, ocv)))
    ohmic = (fields.r0 + values.get(LEAD, 0.0)) * fields.current
    volt = fields.volt + fields.ocv + slow_volt(stack, fields)
    fields = fields._replace(ohmic=ohmic, volt=volt)
    fields = through("overpotential", fields)
    template = values.get("known", 1.0) * stack.template_volt
    fields = fields._replace(volt=fields.volt + fields.ohmic + template)
    fields = through("reading", fields)
    if stack.late_second is None:
        return fields
    return fields._replace(volt=late(stack, fields, stack.late_second))


def late(stack, fields, second):
    """Voltage of the terminals read late by a time [s], scalar or (n,): (n,) [V]."""
    return delayed(
        *(stack.second + APART_SECOND * stack.file, fields.volt, fields.ohmic),
        delay_second=second,
        step_second=stack.step_second,
        stepped=stack.linear == 0,
    )


class Course(NamedTuple):
    """Fields after the counting of charge, kept: most parameters of a model do not change it.

    of : columns and effects that it was counted from; held here, so that the numbers by which they
    are known stay theirs.
    ocv_volt : OCV over its SoC (n,) [V], by the table and the errors at the knots.
    """

    of: tuple
    fields: Fields
    ocv_volt: dict


def _course(cell, stack, values, early, counted):
    """Course of the fields after the counting: one that is kept, else by the function `counted`.

    early : effects that act before the SoC is known.
    """
    names = start_names(len(stack.first))
    for effect in early:
        names += effect.names
    # An effect of the current may look at the resistances.
    names += LOGARITHMS if early else ()
    of, kept = (stack.held_ampere, stack.celsius, *early), stack.courses
    sizes = (values["capacity"], *(values[name] for name in names))
    key = (cell.capacity_ampere_hour, *sizes, *map(id, of))
    if key not in kept:
        _make_room(kept)
        kept[key] = Course(of, counted(), {})
    if early:
        return kept[key]
    course = kept[key]
    return Course(course.of, _begun(cell, stack, values, course.fields), course.ocv_volt)


def _make_room(kept, most=KEPT_COURSES):
    """Take out the oldest of what is kept, so that one more finds room."""
    while len(kept) >= most:
        del kept[next(iter(kept))]


def _begun(cell, stack, values, counting=None):
    """Fields before the first stage: measured current and temperature, resistances, capacity.

    counting : Fields whose counting of charge holds here, too; None: charge is still to be counted.
    """
    r0, r1, tau1, r2, tau2 = (exp(values[name]) for name in LOGARITHMS)
    if stack.ohmic_course is not None:
        r0 = r0 * stack.ohmic_course
    slow = (1.0, 1.0) if stack.slow_courses is None else stack.slow_courses
    if counting is None:
        capacity = cell.capacity_ampere_hour * (1.0 + values["capacity"])
        counts = stack.held_ampere, NONE, capacity, NONE
    else:
        counts = counting.held, counting.moved, counting.capacity, counting.soc
    return Fields(
        *(stack.current_ampere, *counts, stack.celsius),
        *(r0, r1, r2, tau1, tau2, slow, stack.tau_course, NONE, NONE, 0.0),
    )


def _counted(stack, values, fields):
    """SoC by counting, each record from its own start.

    Where another row than the first is the anchor (the end of a full charge), its SoC stays where
    it is when another capacity or current counts otherwise, and the start moves: `soc0` is the
    start by the first count.
    """
    starts = np.array([values[name] for name in start_names(len(stack.first))])
    moved = np.cumsum(fields.moved / fields.capacity)
    if stack.anchor_row is not None:
        starts = starts + stack.anchor_rise - (moved[stack.anchor_row] - moved[stack.first])
    soc = np.clip(moved + (starts - moved[stack.first])[stack.file], *SOC_LIMITS)
    return fields._replace(soc=soc)


def _open_circuit(cell, values, soc, course):
    """OCV of the table plus its error, straight between the knots [V]; kept for a course's SoC."""
    knots = tuple([values[name] for name in OCV_NAMES])
    if soc is not course.fields.soc:
        return looked_up(cell, knots, soc)
    key, kept = (id(cell.ocv_volt), knots), course.ocv_volt
    if key not in kept:
        _make_room(kept)
        kept[key] = cell.ocv_volt, looked_up(cell, knots, soc)
    return kept[key][1]


def _at_surface(cell, stack, fields, ocv_volt):
    """OCV with that of the table at the particles' surface; its errors stay as they are [V]."""
    if np.ndim(fields.lead) == 0:
        return ocv_volt
    columns = fields.soc, cell.ocv_volt
    within = kept_response(stack, columns, (_at_surface,), lambda: cell.ocv_at(fields.soc))
    return ocv_volt + cell.ocv_at(fields.soc + fields.lead) - within


def looked_up(cell, knots, soc):
    """OCV at each SoC by the table and its error at the knots [V]."""
    return cell.ocv_at(soc) + held_on_grid(np.array(knots, float), soc)


def slow_volt(stack, fields):
    """Voltage of the two RC pairs [V]."""
    pairs = zip((fields.r1, fields.r2), fields.slow, (fields.tau1, fields.tau2), strict=True)
    return sum(_pair_volt(stack, fields, *pair) for pair in pairs)


def _pair_volt(stack, fields, ohm, factor, tau):
    """Voltage of an RC pair; that of one ohm is kept where nothing but its resistance moved [V]."""
    if isinstance(ohm, np.ndarray) or fields.current is not stack.current_ampere:
        return relaxed(stack, ohm * factor * fields.current, tau, tau_factor=fields.tau_factor)
    columns = fields.current, factor, fields.tau_factor

    def of_one_ohm():
        return relaxed(stack, fields.current * factor, tau, tau_factor=fields.tau_factor)

    return ohm * kept_response(stack, columns, (relaxed, tau), of_one_ohm)


def relaxed(stack, drive, tau_second, *, tau_factor=1.0):
    """First-order lag of a drive (n,), at rest at the start of every record; unit of the drive.

    tau_factor : factor of the time constant [1], (n,) or a scalar: time runs so much slower.
    """
    clock = stack.step_second / tau_factor, stack.fresh, stack.linear
    return lag_fresh(*clock, drive, tau_second, np.zeros(len(drive)))


def slowed(stack, fields, factors, *, tau_factor=1.0):
    """Fields with the resistances and time constants of the RC pairs times factors (n,) [1].

    factors : two, of the resistance of either pair. tau_factor : of both time constants.
    """
    slow = tuple(map(partial(_product, stack), fields.slow, factors))
    return fields._replace(slow=slow, tau_factor=_product(stack, fields.tau_factor, tau_factor))


def _product(stack, *factors):
    """Product of two factors, kept where both are (n,); of a scalar that is one, the other."""
    if all(map(np.ndim, factors)):
        return kept_response(stack, factors, (), lambda: np.multiply(*factors))
    scalar, other = sorted(factors, key=np.ndim)
    return other if scalar == 1.0 else scalar * other


def kept_response(stack, columns, sizes, make):
    """Return the cached response to columns and sizes (n,), or make and cache it.

    Most parameters that a fit moves change neither.

    Parameters
    ----------
    stack : records.Stack. columns : tuple of (n,), held with what is kept, so that the numbers by
    which they are known stay theirs. sizes : tuple. make : function () → (n,).
    """
    key, kept = (*map(id, columns), *sizes), stack.responses
    if key in kept:
        kept[key] = kept.pop(key)  # now the last one used
    else:
        _make_room(kept, KEPT_RESPONSES)
        kept[key] = columns, make()
    return kept[key][1]


class Tolerance(NamedTuple):
    """Standard deviations of what is known before the fit.

    ocv_volt : error of the OCV table, smooth over `ocv_soc`. capacity : relative.
    soc : of the state of charge at the start of a record. steep_soc : an error of the SoC that no
    parameter follows, so that rows on a steep OCV count less. known : relative, of the scale of the
    template of healthy cells in this cell (paired mode). kelvin : of a temperature that no sensor
    told.
    """

    ocv_volt: float = 0.0015  # repeats of a C/20 test on good cyclers; 5 mV hides effects
    ocv_soc: float = 0.12
    capacity: float = 0.003  # repeats of a capacity test on good cyclers
    soc: float = 0.02
    steep_soc: float = 0.003
    known: float = 0.2
    kelvin: float = 2.0  # of a cell beside its chamber


def frees(stack, start, tolerance, log_std=None, starts=None):
    """Free parameters of the plain model.

    Parameters
    ----------
    stack : records.Stack. start : dict of first values. tolerance : Tolerance.
    log_std : standard deviations of the logarithms by name, about the first values; None: LOG_STD.
    starts : Free of the SoC at the start of each record; None: as stated, within its tolerance.

    Returns
    -------
    free : tuple of least_squares.Free, in the order of `base_names`; in paired mode the scale of
        the template of healthy cells after them, and the resistance of contacts.
    """
    stds = log_std or LOG_STD
    limits = {name: np.log((1e-7, 10.0)) for name in LOGARITHMS}
    limits |= {f"log_{name}": np.log(second) for name, second in TAU_SECOND.items()}
    logs = [Free(n, LOG_STEP, start[n], stds[n], *limits[n]) for n in LOGARITHMS]
    capacity = Free("capacity", LOG_STEP / 10, 0.0, tolerance.capacity)
    socs = starts or [
        Free(name, SOC_STEP, soc, tolerance.soc) for name, soc in stated_starts(stack).items()
    ]
    knots = [Free(name, VOLT_STEP) for name in OCV_NAMES]
    scale = [Free("known", LOG_STEP, 1.0, tolerance.known)] if stack.template_volt.any() else []
    lead, ohm = [], float(np.exp(start["log_r0"]))
    if stack.ohmic_course is not None and log_std is None:
        # Of contacts beyond those of the cells whose courses a stack has. Contacts add to the
        # resistance; they may not take from it, as a steeper course would.
        lead = [Free(LEAD, LOG_STEP * ohm, 0.0, ohm, 0.0, MOST_LEAD * ohm)]
    return (*logs, capacity, *socs, *knots, *scale, *lead)


def coupling(free, tolerance):
    """Prior precision (k, k) of the OCV's error: of its tolerance's size, smooth over SoC."""
    soc = np.linspace(0.0, 1.0, OCV_KNOTS)
    near = np.exp(-0.5 * (np.subtract.outer(soc, soc) / tolerance.ocv_soc) ** 2)
    covariance = tolerance.ocv_volt**2 * (near + OWN_KNOT**2 * np.eye(len(soc)))
    precision = np.zeros((len(free), len(free)))
    knots = [k for k, parameter in enumerate(free) if parameter.name.startswith("ocv[")]
    precision[np.ix_(knots, knots)] = np.linalg.inv(covariance)
    return precision


def ocv_stds(cell, tolerance):
    """How far the OCV may be off at each knot: its tolerance, and where it is steep more (16,) [V].

    There an error of the SoC is one of the voltage, the steepest next to the knot.
    """
    near = np.linspace(-0.5, 0.5, 21)
    soc = (np.arange(OCV_KNOTS)[:, None] + near) / (OCV_KNOTS - 1)
    steepest = np.abs(slopes(cell, soc)).max(axis=1)
    return np.hypot(tolerance.ocv_volt, tolerance.steep_soc * steepest)


def starts_of(cell, stack, values, effects=()):
    """SoC at the start of each record by a model [1]: dict by test.

    Parameters
    ----------
    cell, stack, values, effects : as in `voltage`.
    """
    soc = fields_of(cell, stack, values, effects).soc[stack.first]
    return dict(zip(stack.tests, soc.tolist(), strict=True))


def steep_volt(cell, soc, tolerance):
    """Error of a steep OCV by an error `steep_soc` of the SoC [V]: (n,); 0 where it is flat."""
    slope = np.abs(slopes(cell, soc))
    usual = STEEP * abs(np.median(np.diff(cell.ocv_volt))) * (len(cell.ocv_volt) - 1)
    return tolerance.steep_soc * np.maximum(slope - usual, 0.0)


def slopes(cell, soc):
    """Slope of the OCV over SoC at each SoC, of the shape of `soc` [V]."""
    return usual_slope(cell.ocv_volt, soc)
