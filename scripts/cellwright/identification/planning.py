"""Which tests would lower the error of a cell's particle most, for a wanted use and some hours.

Bayesian design of experiments about the particle's posterior (`particle`). 1. What is known of the
cell is the most likely particle and the precision of its numbers: the prior's, and what the rows of
the tests made so far add. 2. A candidate test is simulated, up to the cut-off, and adds what its
rows would tell, each with the error that a fit takes it to have. 3. What counts is the expected
variance of the voltage over the wanted use, the mean of dV/dp · covariance · dV/dp (V-optimal
design). 4. That test is taken first that lowers its logarithm most per hour, then the next one
beside it, as long as hours are left. All this is done at several particles drawn from what is known
and averaged, for where little is known a test tells more of one cell than of another.

Source: K. Chaloner, I. Verdinelli, Statistical Science 10 (1995) 273.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import POINTS
from cellwright.circuits.particle import SCALES, Particle, layout, of_document, run
from cellwright.circuits.temperature import temperature_weights
from cellwright.identification.in_use import fitted_records, particle_task
from cellwright.identification.particle import PRIORS, information, task_of
from cellwright.numerics.lines import ZERO_CELSIUS_KELVIN
from cellwright.records.conditions import REFERENCE_CELSIUS, grouped_alike, same_temperature
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

CAPACITY_C_RATES = (1 / 20, 1 / 10, 1 / 5, 1 / 2, 1.0)
# ASSUME: Before each test a cell is charged in full at C/2 and takes the chamber's temperature.
READY_HOUR = 4.0
LEVELS, BETWEEN_C_RATE, REST_SECOND = 10, 0.5, 1800.0  # of an HPPC, and between its levels
PULSE_SECOND, AFTER_PULSE_SECOND = 10.0, 40.0
BACK_SHARE = 0.5  # of the current of a load, of that back into the cell after it
LOAD_SECOND, PAUSE_SECOND = 60.0, 20.0  # of the wanted use: each rate in turn, pauses between
BEYOND = 1.02  # of the capacity, that a load to the cut-off may take
STEADY_SECOND, PORTION_SOC = 30.0, 0.0025  # at most from row to row
DRIVE_SECOND = 1.0
# Without a slow test the OCV is somewhere between the cut-offs: of their distance, its deviation.
UNKNOWN_OCV_SHARE = 0.1
DRAWS, SEED = 4, 0  # beside the most likely particle
LEAST_ROWS = 10  # of a test, or of a use, that a cell can serve


class Use(NamedTuple):
    """What a model is wanted for: temperatures [degC], C-rates of its loads [1/h], lowest and
    highest SoC [1]."""

    celsius: tuple
    c_rates: tuple
    soc: tuple


class Knowledge(NamedTuple):
    """What is known of a cell: the most likely Particle, the precision (p, p) of its vector, the
    capacity that its SoC refers to [Ah], its lower and upper cut-off [V]."""

    particle: Particle
    precision: np.ndarray
    capacity_ampere_hour: float
    cutoffs_volt: tuple


class Candidate(NamedTuple):
    """A test that could be made: kind, what it is in words, temperature of the chamber [degC],
    hours that it takes with what comes before it, and its current (n,), which a cell follows as far
    as its cut-offs let it; soc : at its start."""

    kind: str
    words: str
    celsius: float
    hours: float
    test_time_second: np.ndarray
    current_ampere: np.ndarray
    soc: float = 1.0


class PlannedTest(NamedTuple):
    """A test of a plan: what it is, its temperature [degC], its hours, and the expected RMS error
    of the voltage over the wanted use before and after it [V], geometric means over the cells that
    what is known leaves open; low, high : the least and most of these after it, about two thirds of
    all such cells."""

    kind: str
    test: str
    ambient_temperature_celsius: float
    hours: float
    before_volt: float
    after_volt: float
    after_low_volt: float
    after_high_volt: float


def knowledge_from_tests(task, particle, cutoffs_volt):
    """What a fit to tests that were made tells of a cell.

    Parameters
    ----------
    task : particle.Task of these tests. particle : Particle, as it was fitted to them.
    cutoffs_volt : lower and upper cut-off [V].

    Returns
    -------
    knowledge : Knowledge.
    """
    precision = task.precision + information(task, particle)
    return Knowledge(particle, precision, task.capacity_ampere_hour, tuple(cutoffs_volt))


def knowledge_from_model(model, basis, cell, tests, *, split_rest_second):
    """What the tests that a model was identified from tell of its particle.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. basis : dict, from `basis.basis`, or None.
    cell : CellFacts. tests : list of MeasuredTest, at least those fitted.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    knowledge : Knowledge.

    Raises
    ------
    Refusal : a model without a particle or not of tests of its own, a cell without cut-offs, tests
        that cannot be read again.
    """
    if not model.get("particle"):
        raise Refusal(
            f"the model of {cell.cell} has no particle; wanted one: member P among `models: "
            "members`, tests of the cell's own and a C compiler"
        )
    cutoffs_volt = cell.lower_cutoff_volt, cell.upper_cutoff_volt
    if None in cutoffs_volt:
        raise Refusal(f"{cell.cell}: cells.tsv states the cut-offs {cutoffs_volt}; wanted both")
    fitted = fitted_records(model, basis, cell, tests, split_rest_second=split_rest_second)
    about = basis, cell, tests
    task, _ = particle_task(model, fitted, *about, split_rest_second=split_rest_second)
    return knowledge_from_tests(task, of_document(model["particle"]), cutoffs_volt)


def knowledge_from_rating(capacity_ampere_hour, cutoffs_volt):
    """What rating and cut-offs tell of a cell that no test was made of: the particle's prior.

    Parameters
    ----------
    capacity_ampere_hour : rated [Ah]. cutoffs_volt : lower and upper [V].

    Returns
    -------
    knowledge : Knowledge, at the reference temperature.

    Raises
    ------
    Refusal : a rating or cut-offs that no cell has.
    """
    low, high = cutoffs_volt
    if not capacity_ampere_hour > 0:
        raise Refusal(f"rated capacity {capacity_ampere_hour:g} Ah; wanted more than 0")
    if not 0 <= low < high:
        raise Refusal(f"cut-offs {low:g} and {high:g} V; wanted the lower one first, none negative")
    # ASSUME: The OCV of an unknown cell rises evenly through the upper half between its cut-offs.
    grid = np.linspace(0.0, 1.0, POINTS)
    ocv_volt = low + (high - low) * (1.0 + grid) / 2.0
    time, current = _discharge(1.0, capacity_ampere_hour)
    soc = _counted(time, current, 1.0, capacity_ampere_hour)
    any_test = record_of(time, current, np.full(len(time), high), soc, kind="capacity")
    task = _task(any_test, ocv_volt, capacity_ampere_hour)
    place = layout(1)["ocv_shift_volt"]
    wider = PRIORS["ocv_shift_volt"].std / (UNKNOWN_OCV_SHARE * (high - low))
    precision = task.precision.copy()
    precision[place, place] *= wider**2
    return Knowledge(task.start, precision, capacity_ampere_hour, (low, high))


def candidates_of(knowledge, chamber_celsius, use, *, drives=False):
    """Tests that a laboratory could make of a full cell.

    Capacity tests from C/20 to 1C and pulses at ten levels of the SoC, at each temperature.

    Parameters
    ----------
    knowledge : Knowledge. chamber_celsius : temperatures that the chamber reaches [degC].
    use : Use, whose rates the pulses have. drives : whether a drive with the loads of the use may
        be fitted too.

    Returns
    -------
    candidates : list of Candidate.

    Raises
    ------
    Refusal : a use of no load or SoC.
    """
    _refuse_use(use)
    capacity, found = knowledge.capacity_ampere_hour, []
    c_rates, rates = use.c_rates, ", ".join(f"{rate:g}C" for rate in use.c_rates)
    shapes = [("capacity", _rate_words(r), _discharge(r, capacity)) for r in CAPACITY_C_RATES]
    shapes.append(("hppc", f"pulses of {rates}", _pulses(c_rates, capacity)))
    if drives:
        shapes.append(("drive", f"drive of {rates}", _loads(c_rates, capacity, _every_second)))
    for celsius in chamber_celsius:
        for kind, words, (time, current) in shapes:
            hours = READY_HOUR + float(time[-1]) / 3600.0
            found.append(Candidate(kind, words, float(celsius), hours, time, current))
    return found


def plan(knowledge, candidates, use, *, hours):
    """The tests that lower the expected error of a model most, one after another.

    Parameters
    ----------
    knowledge : Knowledge. candidates : list of Candidate, each taken once at most.
    use : Use. hours : that all tests together may take.

    Returns
    -------
    planned : list of PlannedTest, in the order in which they are best made.
    ranked : list of PlannedTest, each candidate by itself, that first which lowers most per hour.

    Raises
    ------
    Refusal : no candidate takes so few hours; a use of no load or SoC, or that the
        cell cannot serve.
    """
    _refuse_use(use)
    _refuse_hours(hours, candidates)
    every_celsius = [*(one.celsius for one in candidates), *use.celsius]
    knowledge = _at_temperatures(knowledge, every_celsius)
    cells = _draw_cells(knowledge)
    moments = [_use_moment(knowledge, cell, use) for cell in cells]
    informations = [[_information_of(knowledge, cell, one) for cell in cells] for one in candidates]
    precisions, left = [knowledge.precision] * len(cells), list(range(len(candidates)))
    planned, spent = [], 0.0
    ranked = _ranked(candidates, informations, precisions, moments)
    while True:
        open_ones = [
            (number, step)
            for _, number, step in _ranked(candidates, informations, precisions, moments)
            if number in left and spent + step.hours <= hours
        ]
        if not open_ones:
            return planned, [step for *_, step in ranked]
        number, step = open_ones[0]
        planned.append(step)
        spent += step.hours
        left.remove(number)
        precisions = [a + b for a, b in zip(precisions, informations[number], strict=True)]


def _ranked(candidates, informations, precisions, moments):
    """(gain per hour, number of the candidate, PlannedTest) of each, the largest gain first."""
    before = [_error_volt(*pair) for pair in zip(precisions, moments, strict=True)]
    found = []
    for number, (one, added) in enumerate(zip(candidates, informations, strict=True)):
        after = [
            _error_volt(precision + new, moment)
            for precision, new, moment in zip(precisions, added, moments, strict=True)
        ]
        means = [float(np.exp(np.mean(np.log(errors)))) for errors in (before, after)]
        about = (one.kind, one.words, one.celsius, one.hours)
        step = PlannedTest(*about, *means, min(after), max(after))
        found.append((np.log(means[0] / means[1]) / one.hours, number, step))
    return sorted(found, key=lambda entry: -entry[0])


def _error_volt(precision, moment):
    """Expected RMS error of the voltage [V]: of what (p, p) is known of a cell, over a use."""
    return float(np.sqrt(np.trace(np.linalg.solve(precision, moment))))


def _refuse_use(use):
    low, high = use.soc
    if not 0.0 <= low < high <= 1.0:
        raise Refusal(f"SoC from {low:g} to {high:g}; wanted two rising numbers within 0 to 1")
    sound = all(rate > 0 for rate in use.c_rates)
    sound &= all(celsius > -ZERO_CELSIUS_KELVIN for celsius in use.celsius)
    if not sound or not use.celsius or not use.c_rates:
        found = f"temperatures {list(use.celsius)} °C and C-rates {list(use.c_rates)} of the use"
        raise Refusal(f"{found}; wanted at least one of each, rates above 0")


def _refuse_hours(hours, candidates):
    if not candidates:
        raise Refusal("no test to choose from; wanted at least one temperature of the chamber")
    least = min(candidates, key=lambda one: one.hours)
    if not least.hours <= hours:
        raise Refusal(
            f"{hours:g} h: no test fits; the shortest, {least.words} at {least.celsius:g} °C, "
            f"takes {least.hours:.1f} h, of which {READY_HOUR:g} h for the charge and the chamber"
        )


def _at_temperatures(knowledge, celsius):
    """Knowledge with the SoC's scale at further temperatures, as a fit to tests there has it.

    It is expected to be as between its neighbours there, with the prior's deviation.
    """
    old = knowledge.particle
    groups = grouped_alike(celsius, same_temperature)
    new = [
        group[0] for group in groups if not any(same_temperature(group[0], c) for c in old.celsius)
    ]
    every = np.array(sorted([*old.celsius, *new]), float)
    before, after = layout(len(old.celsius)), layout(len(every))
    kept = np.searchsorted(every, old.celsius)
    weights = np.array(temperature_weights(old.celsius, every))
    size = max(place.stop for place in after.values())
    vector, precision, index = np.zeros(size), np.zeros((size, size)), []
    for name, place in after.items():
        numbers = np.arange(size)[place]
        if name in SCALES:
            vector[place] = old.vector[before[name]] @ weights
            fresh = np.delete(numbers, kept)
            precision[fresh, fresh] = PRIORS[name].std ** -2.0
            numbers = numbers[kept]
        else:
            vector[place] = old.vector[before[name]]
        index.append(numbers)
    index = np.concatenate(index)
    precision[np.ix_(index, index)] = knowledge.precision
    return knowledge._replace(particle=Particle(old.ocv_volt, every, vector), precision=precision)


def _draw_cells(knowledge):
    """The most likely cell, and others that what is known leaves open."""
    # x = L⁻ᵀ·n has the covariance (L·Lᵀ)⁻¹ of the precision.
    root = np.linalg.cholesky(knowledge.precision)
    normal = np.random.default_rng(SEED).normal(size=(DRAWS, len(root)))
    vectors = knowledge.particle.vector + np.linalg.solve(root.T, normal.T).T
    return [knowledge.particle, *(knowledge.particle._replace(vector=vector) for vector in vectors)]


def _use_moment(knowledge, cell, use):
    """Mean over the wanted use of dV/dp by dV/dp (p, p), all temperatures alike."""
    low, high = use.soc
    capacity, moments = knowledge.capacity_ampere_hour, []
    time, current = _loads(use.c_rates, capacity, _sparse, share=high - low)
    for celsius in use.celsius:
        soc = _counted(time, current, high, capacity)
        simulated = run(
            cell, time, current, soc, celsius, capacity_ampere_hour=capacity, derivatives=True
        )
        rows = _until_empty(simulated.voltage_volt, current, knowledge.cutoffs_volt[0])
        if rows < LEAST_ROWS and cell is knowledge.particle:
            raise Refusal(
                f"at {celsius:g} °C a load of {max(use.c_rates):g}C from SoC {high:g} on ends at "
                f"the cut-off of {knowledge.cutoffs_volt[0]:g} V within {time[rows]:.0f} s, by "
                "what is known of the cell; wanted a use that it can serve: lower rates or warmer"
            )
        by, stands_for = simulated.by[:rows], np.gradient(time)[:rows]
        moments.append((by * stands_for[:, None]).T @ by / stands_for.sum())
    return np.mean(moments, axis=0)


def _information_of(knowledge, cell, candidate):
    """What a candidate's rows would add to the precision (p, p) of a cell's numbers."""
    capacity, (low, high) = knowledge.capacity_ampere_hour, knowledge.cutoffs_volt
    time, current = candidate.test_time_second, candidate.current_ampere
    soc = _counted(time, current, candidate.soc, capacity)
    settings = {"capacity_ampere_hour": capacity}
    volt = run(cell, time, current, soc, candidate.celsius, **settings).voltage_volt
    # Pulses that reach a cut-off are cut short and the test goes on; what empties the cell ends it.
    emptying = current if candidate.kind != "hppc" else np.where(_between(current, capacity), -1, 0)
    rows = _until_empty(volt, emptying, low)
    used = (volt[:rows] >= low) & (volt[:rows] <= high)
    if used.sum() < LEAST_ROWS:
        return np.zeros_like(knowledge.precision)
    record = record_of(
        *(column[:rows] for column in (time, current, volt, soc)),
        kind=candidate.kind,
        celsius=candidate.celsius,
        used=used,
    )
    return information(_task(record, cell.ocv_volt, capacity), cell)


def _task(record, ocv_volt, capacity):
    """Task of one record, whose rows have errors and weights as in any fit."""
    grid = np.linspace(0.0, 1.0, len(ocv_volt))
    curve = {"soc": grid, "ocv_volt": ocv_volt, "ambient_temperature_celsius": REFERENCE_CELSIUS}
    blocks = [np.zeros(record.used.sum(), int)]
    condition = (float(record.celsius.mean()), [record], [record], blocks)
    return task_of([condition], [curve], capacity_ampere_hour=capacity)


def _until_empty(volt, current, cutoff_volt):
    """How many rows there are until a load reaches the lower cut-off."""
    ends = np.flatnonzero((volt < cutoff_volt) & (current < 0))
    return int(ends[0]) if len(ends) else len(volt)


def _counted(time, current, soc, capacity):
    passed = np.cumsum((current[1:] + current[:-1]) / 2.0 * np.diff(time))
    return soc + np.append(0.0, passed) / 3600.0 / capacity


def _discharge(c_rate, capacity):
    """Time and current of a discharge of a full cell at one rate."""
    second = BEYOND * 3600.0 / c_rate
    every = min(STEADY_SECOND, PORTION_SOC * 3600.0 / c_rate)
    return _joined([(-c_rate * capacity, second)], lambda last: _sparse(last, every))


def _pulses(c_rates, capacity):
    """Time and current of an HPPC: at each level a pulse out and one back of each rate."""
    parts = []
    for _ in range(LEVELS):
        for rate in c_rates:
            for share in (-1.0, BACK_SHARE):
                parts += [(share * rate * capacity, PULSE_SECOND), (0.0, AFTER_PULSE_SECOND)]
        between = (-BETWEEN_C_RATE * capacity, 3600.0 / LEVELS / BETWEEN_C_RATE)
        parts += [between, (0.0, REST_SECOND)]
    return _joined(parts, _sparse)


def _between(current, capacity):
    return np.isclose(current, -BETWEEN_C_RATE * capacity)


def _loads(c_rates, capacity, rows, *, share=1.0):
    """Time and current of a use: each rate for a minute, then a tenth of that back, until a share
    of the capacity has passed."""
    parts, left = [], share
    back_second = LOAD_SECOND / 6.0
    while left > 0:
        for rate in c_rates:
            ampere = rate * capacity
            parts += [(-ampere, LOAD_SECOND), (0.0, PAUSE_SECOND)]
            parts += [(BACK_SHARE * ampere, back_second), (0.0, PAUSE_SECOND)]
            left -= rate * (LOAD_SECOND - BACK_SHARE * back_second) / 3600.0
    return _joined(parts, rows)


def _joined(parts, rows):
    """Time and current of parts (ampere, seconds), after a rest; rows : ages of a part's rows."""
    time, current = [np.zeros(1)], [np.zeros(1)]
    for ampere, second in parts:
        ages = np.append(1e-3, rows(second))
        time.append(time[-1][-1] + ages)
        current.append(np.full(len(ages), ampere))
    return np.concatenate(time), np.concatenate(current)


def _sparse(second, every=STEADY_SECOND):
    """Ages of rows that lie ever further apart."""
    return np.unique(
        np.concatenate(
            [np.geomspace(0.1, min(second, every), 12), np.arange(every, second, every), [second]]
        )
    )


def _every_second(second):
    return np.arange(DRIVE_SECOND, second + DRIVE_SECOND / 2.0, DRIVE_SECOND)


def _rate_words(c_rate):
    return f"discharge at {c_rate:g}C" if c_rate >= 1.0 else f"discharge at C/{1.0 / c_rate:g}"
