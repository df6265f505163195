"""Tables and record laid out as arrays for a filter, and their values at one SoC."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import place
from cellwright.filters.bank import NODES, drives
from cellwright.numerics.clock import checked_columns
from cellwright.numerics.lags import lag, lag_weights
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal


def levels_of(bank, current_ampere, curved):
    """RMS of every element's drive over a record at half charge (E,) [V].

    One level for the whole record: with noise in proportion to the current an error of a resistance
    would count at rest and not under load, and move the SoC off with every cycle.

    Parameters
    ----------
    bank : Bank.
    current_ampere : (n,) [A].
    curved : dict, index of an element that is not linear → its drives (nodes, n).

    Returns
    -------
    level_volt : (E,) [V].
    """
    half, levels = _half(bank), np.zeros(len(bank.elements))
    slope = (bank.ocv_volt[half + 1] - bank.ocv_volt[half - 1]) / (bank.soc[2] - bank.soc[0])
    for k, element in enumerate(bank.elements):
        middle = len(NODES) // 2
        drive = curved[k][middle] if k in curved else element.gain[half] * current_ampere
        levels[k] = rms(drive) * (slope if element.output == "soc" else 1.0)
    return levels


def edges_of(bank, level_volt, step_second, current_ampere, skew_second, *, hold):
    """Variance of the voltage after steps of the current (n,) [V²], from the skew of the sensors.

    Into and out of a load alike, so that it favours neither; a record that starts under load starts
    with a step.

    Parameters
    ----------
    bank : Bank.
    level_volt : (E,) from `levels_of` [V].
    step_second, current_ampere : (n,) [s], [A].
    skew_second : time by which the voltage may follow the current later than it was read [s].
    hold : how the current runs between two samples.

    Returns
    -------
    variance : (n,) [V²].
    """
    # ASSUME: Voltage and current are not read in the same moment, nor through the same filter: for
    # `skew_second` after a step the voltage may still be that of the current before.
    power = np.mean(current_ampere**2)
    if skew_second <= 0.0 or power == 0.0:
        return np.zeros(len(current_ampere))
    at_once = np.array([e.direct for e in bank.elements])
    for element, lagged in bank.lags:
        within = skew_second / (skew_second + lagged.constant[_half(bank)])
        at_once[element] += lagged.share * within * (lagged.clock == "second")
    behind = current_ampere - lag(step_second[1:], skew_second, current_ampere, hold=hold)
    return (level_volt @ at_once) ** 2 / power * behind**2


def _half(bank):
    return int(np.argmin(np.abs(bank.soc - 0.5)))


OCV, TOTAL, SLOPE, ERROR, GAIN = range(5)  # columns of the tables; gains, then constants, follow
TRACKED = ("error", "fast", "standing", "capacity", "ohmic")  # states after SoC and lags
LARGEST = 32  # states that the compiled kernel takes


class Noise(NamedTuple):
    """Noise of sensors and model that a filter assumes.

    sensor_volt : white noise of the voltage sensor, standard deviation [V].
    resistance_error : relative error of what acts at once [1].
    fast_second : for how long an error of what acts at once lasts [s]; 0: it is white.
    steady_error : relative error of all overpotentials together [1]; None: `resistance_error`.
    least_error_volt, least_rest_volt : no model is better than this on another record, under load
        and at rest [V].
    error_second : time over which its error under load stays what it is [s]; 0: it is white.
    error_soc : charge over which its error at rest stays what it is [1]; 0: as that under load.
    soc_walk : variance of the SoC that the current sensor adds, at least and at most [1/s].
    ohmic_walk : variance of the ohmic scale, where that is tracked [1/s].
    skew_second : time by which voltage may follow the current later than it was read [s].
    slope_window_soc : window over which the slope of the OCV is taken [1].
    considered : a capacity among the states is not estimated: its doubt alone is carried along.
    capacity_misread : relative deviation by which records of known capacity were misread [1].
    adaptive : noise is matched to what is seen, over `window` samples.
    """

    sensor_volt: float = 0.002  # where no record that a model was fitted to tells it
    resistance_error: float = 0.1
    fast_second: float = 5.0
    steady_error: float | None = None
    least_error_volt: float = 0.005
    least_rest_volt: float = 0.005
    error_second: float = 150.0
    error_soc: float = 0.3
    soc_walk: tuple = (7e-9, 7e-8)
    ohmic_walk: float = 1e-5
    skew_second: float = 0.2
    slope_window_soc: float = 0.02
    considered: bool = False
    capacity_misread: float = 0.0
    adaptive: bool = True
    window: int = 600


class Plant(NamedTuple):
    """A record and a bank as arrays. n samples, m points of the tables, E elements, L lags.

    step_second, charge_ampere_hour, passed_ampere_hour : (n,) over the step that ends at a sample;
        charge is net, passed counts both ways.
    current_ampere, between_ampere : (n,) at a sample and over the step before it, by which drives
        go: the factor on the resistances is in them.
    voltage_volt, edge_variance : (n,); what a step of the current leaves unknown [V²].
    tables : (m, 4 + E + L): OCV, OCV with shift, its slope, model error, gains, constants of lags.
    soc_first, soc_spacing : their uniform grid.
    shifts_soc, direct, source, by_charge : (E,) whether an element's output is an offset of the
        SoC; the share that acts at once; its row of `drives`, −1 for a gain; its clock.
    drives : (q, nodes, n) of what is not linear in the current. largest : (q,) mean over SoC of the
        largest of them. usual_gain : (E,) median of the gains over SoC 0 to 1, else 0.
    element, share, moves : (L,) of each lag; `moves` where its constant changes over SoC.
    white_variance, fast_variance, slow_variance : of the noise, of what acts at once, and of the
        model's error beside the tables' [V²].
    size : states; error, fast, standing, capacity, ohmic: where they stand, −1 for none.
    """

    step_second: np.ndarray
    charge_ampere_hour: np.ndarray
    passed_ampere_hour: np.ndarray
    current_ampere: np.ndarray
    between_ampere: np.ndarray
    voltage_volt: np.ndarray
    edge_variance: np.ndarray
    tables: np.ndarray
    soc_first: float
    soc_spacing: float
    shifts_soc: np.ndarray
    direct: np.ndarray
    source: np.ndarray
    by_charge: np.ndarray
    drives: np.ndarray
    largest: np.ndarray
    usual_gain: np.ndarray
    element: np.ndarray
    share: np.ndarray
    moves: np.ndarray
    capacity_ampere_hour: float
    white_variance: float
    fast_variance: float
    slow_variance: float
    first_order: bool
    size: int
    error: int
    fast: int
    standing: int
    capacity: int
    ohmic: int


def plant_of(
    bank,
    test_time_second,
    current_ampere,
    voltage_volt,
    noise,
    *,
    hold,
    resistance_factor=1.0,
    track_capacity=False,
    track_ohmic=False,
):
    """Arrays of a bank and a record for the recursion of a filter.

    Parameters
    ----------
    bank : Bank.
    test_time_second, current_ampere, voltage_volt : (n,) [s], [A] positive on charge, [V].
    noise : Noise.
    hold : "first_order" or "zero_order", how the current runs between two samples.
    resistance_factor : scalar or (n,) resistance of the cell at each sample over that at the bank's
        temperature [1].
    track_capacity, track_ohmic : whether capacity and a scale of the ohmic resistance are states.

    Returns
    -------
    plant : Plant.

    Raises
    ------
    Refusal : time runs back, values are not finite, lengths differ, or too many states.
    """
    time, current, voltage = checked_columns(
        {"time": test_time_second, "current": current_ampere, "voltage": voltage_volt}
    )
    step = np.diff(time, prepend=time[0])
    before = np.concatenate([current[:1], current[:-1]])
    between = before if hold == "zero_order" else (before + current) / 2
    by_charge = _by_charge(bank)
    # ASSUME: Along a record all resistances move by one factor; what is linear or kinetic takes it
    # as a factor on the current, what follows the sign of the current does not feel it.
    driving = resistance_factor * current, resistance_factor * between
    curved = [k for k, e in enumerate(bank.elements) if e.gain is None]
    rows = [drives(bank.elements[k], driving[by_charge[k]]) for k in curved]
    drives_of_curved = np.ascontiguousarray(np.reshape(rows, (-1, len(NODES), len(time))))
    levels = levels_of(bank, driving[0], dict(zip(curved, rows, strict=True)))
    constants = [lagged.constant for _, lagged in bank.lags]
    # Empty and full are points of the bank's grid, and belong to the range.
    inside = (bank.soc >= 0.0) & (bank.soc <= 1.0)
    usual = [0.0 if e.gain is None else np.median(e.gain[inside]) for e in bank.elements]
    spots = _places(bank, noise, track_capacity, track_ohmic)
    skew = noise.skew_second
    return Plant(
        step_second=step,
        charge_ampere_hour=between * step / 3600.0,
        passed_ampere_hour=np.abs(between) * step / 3600.0,
        current_ampere=np.ascontiguousarray(driving[0]),
        between_ampere=np.ascontiguousarray(driving[1]),
        voltage_volt=voltage,
        edge_variance=edges_of(bank, levels, step, driving[0], skew, hold=hold),
        tables=_tables(bank, noise, constants),
        soc_first=float(bank.soc[0]),
        soc_spacing=float(bank.soc[1] - bank.soc[0]),
        shifts_soc=np.array([e.output == "soc" for e in bank.elements], np.int64),
        direct=np.array([e.direct for e in bank.elements]),
        source=np.array(
            [(curved.index(k) if k in curved else -1) for k in range(len(bank.elements))], np.int64
        ),
        by_charge=by_charge,
        drives=drives_of_curved,
        largest=np.array([np.abs(drive).max(axis=1).mean() for drive in drives_of_curved]),
        usual_gain=np.array(usual, float),
        element=np.array([element for element, _ in bank.lags], np.int64),
        share=np.array([lagged.share for _, lagged in bank.lags], float),
        moves=np.array([np.ptp(c) > 1e-9 * c.max() for c in constants], np.int64),
        capacity_ampere_hour=float(bank.capacity_ampere_hour),
        first_order=hold == "first_order",
        **_variances(bank, levels, noise),
        **spots,
    )


def levels_of_plant(bank, plant):
    """As `levels_of`, of the record and the bank that a plant was laid out with."""
    curved = {k: plant.drives[row] for k, row in enumerate(plant.source) if row >= 0}
    return levels_of(bank, plant.current_ampere, curved)


def with_tracked(plant, bank, noise, *, track_capacity, track_ohmic):
    """The same plant with other tracked states.

    Parameters
    ----------
    plant : Plant. bank, noise, track_capacity, track_ohmic : as in `plant_of`.

    Raises
    ------
    Refusal : too many states.
    """
    return plant._replace(**_places(bank, noise, track_capacity, track_ohmic))


OF_SAMPLES = ("step_second", "charge_ampere_hour", "passed_ampere_hour", "current_ampere")
OF_SAMPLES += ("between_ampere", "voltage_volt", "edge_variance")


def piece_of(plant, rows):
    """The plant of some of its samples alone, before the first of which nothing flows.

    Parameters
    ----------
    plant : Plant. rows : slice.
    """
    columns = {name: getattr(plant, name)[rows].copy() for name in OF_SAMPLES}
    for name in OF_SAMPLES[:3]:
        columns[name][:1] = 0.0
    return plant._replace(**columns, drives=np.ascontiguousarray(plant.drives[..., rows]))


def load_error_volt(bank, levels):
    """What the circuit of a bank adds to its error under the loads of a record [V].

    Parameters
    ----------
    bank : Bank. levels : (E,) from `levels_of` [V].
    """
    at_once = float(levels @ [e.direct for e in bank.elements])
    return bank.load_error_volt + float(bank.load_shares @ [at_once, levels.sum() - at_once])


def _variances(bank, levels, noise):
    """White, fast (seconds) and slow (minutes) variance of the voltage [V²]."""
    at_once = float(levels @ [e.direct for e in bank.elements])
    fast = (noise.resistance_error * at_once) ** 2
    steady = noise.resistance_error if noise.steady_error is None else noise.steady_error
    load = max(load_error_volt(bank, levels), noise.least_error_volt)
    return {
        "white_variance": noise.sensor_volt**2 + (0.0 if noise.fast_second > 0.0 else fast),
        "fast_variance": fast,
        "slow_variance": (steady * float(levels.sum())) ** 2 + load**2,
    }


def _places(bank, noise, track_capacity, track_ohmic):
    """Index of each tracked state after SoC and lags, −1 if not tracked, and their number."""
    errors = (noise.error_second, noise.fast_second, noise.error_soc)
    tracked = (*(span > 0 for span in errors), track_capacity, track_ohmic)
    elements, spots, size = len(bank.elements), {}, 1 + len(bank.lags)
    for name, is_tracked in zip(TRACKED, tracked, strict=True):
        spots[name] = size if is_tracked else -1
        size += int(is_tracked)
    if max(size, elements) > LARGEST:
        sizes = f"{size} states and {elements} elements"
        raise Refusal(f"the filter would have {sizes}; at most {LARGEST} are allowed")
    return spots | {"size": size}


def _by_charge(bank):
    by_charge = np.zeros(len(bank.elements), np.int64)
    for element, lagged in bank.lags:
        by_charge[element] = lagged.clock == "ampere_hour"
    return by_charge


def _tables(bank, noise, constants):
    """Tables (m, 4 + E + L) with all columns of one SoC next to each other in memory."""
    total, half = bank.ocv_volt + bank.shift_volt, noise.slope_window_soc / 2
    ends = [np.interp(bank.soc + side, bank.soc, total) for side in (-half, half)]
    width = [np.interp(bank.soc + side, bank.soc, bank.soc) for side in (-half, half)]
    slope = (ends[1] - ends[0]) / (width[1] - width[0])
    error = np.maximum(bank.error_volt, noise.least_rest_volt)
    gains = [np.zeros(len(slope)) if e.gain is None else e.gain for e in bank.elements]
    columns = [bank.ocv_volt, total, slope, error, *gains, *constants]
    return np.ascontiguousarray(np.column_stack(columns), float)


SPREAD = np.sqrt(3.0)  # of a chord, in standard deviations: that of a Gaussian's three-point rule


def slope_at(plant, soc, variance, noise):
    """Slope of the OCV as a chord over the uncertainty of the SoC, and the chord's error [V]."""
    reach = SPREAD * np.sqrt(variance)
    if reach <= noise.slope_window_soc / 2:
        return look_at(plant, soc, SLOPE), 0.0
    low, high = max(soc - reach, min(soc, 0.0)), min(soc + reach, max(soc, 1.0))
    ends = look_at(plant, np.array([low, (low + high) / 2, high]), TOTAL)
    return (ends[2] - ends[0]) / (high - low), ends[1] - (ends[0] + ends[2]) / 2


def relaxation_at(plant, k, j, soc):
    """Decay of lag j over the step to sample k, and the contribution of its drive."""
    e = plant.element[j]
    column = GAIN + len(plant.direct) + j
    row = place_on(plant, soc + plant.soc_spacing / 2)[0] if plant.moves[j] else 0
    constant, drive = plant.tables[row, column], drive_at(plant, e, k, soc)
    if plant.by_charge[e]:
        gain = -np.expm1(-plant.passed_ampere_hour[k] / constant)
        return 1.0 - gain, gain * drive
    hold = "first_order" if plant.first_order else "zero_order"
    step = plant.step_second[k : k + 1]
    decay, before, after = (w[0] for w in lag_weights(step, constant, hold=hold))
    return decay, before * drive_at(plant, e, k - 1, soc) + after * drive


def drive_at(plant, e, k, soc):
    """Drive of element e at samples k and SoC, one of both or as many of each [V] or [1]."""
    if plant.source[e] < 0:
        current = plant.between_ampere if plant.by_charge[e] else plant.current_ampere
        return current[k] * look_at(plant, soc, GAIN + e)
    node, share = place(np.clip(soc, 0.0, 1.0), len(NODES))
    low, high = (plant.drives[plant.source[e], node + side, k] for side in (0, 1))
    return low + share * (high - low)


def look_at(plant, soc, column=None):
    """Tables at SoC, linear between two points: one column (of the shape of soc), or all (…, c)."""
    row, share = place_on(plant, soc)
    if column is None:
        low, high = plant.tables[row], plant.tables[row + 1]
        return low + share[..., None] * (high - low)
    low, high = plant.tables[row, column], plant.tables[row + 1, column]
    return low + share * (high - low)


def place_on(plant, soc):
    """As `cell.place`, on the grid of a plant's tables."""
    return place(soc, len(plant.tables), first=plant.soc_first, spacing=plant.soc_spacing)
