"""Courses of OCV shift, resistances and hysteresis over SoC, and time constants, from records.

Once time constants, charge constant and kinetic scale are held, everything else is linear
(`regression`). So only those few numbers are searched for (variable projection, Golub &
Pereyra 1973): time constants over all combinations of a grid, which is global, then by least
squares from the best; charge constant and kinetic scale over a short list.
"""

from functools import cache
from itertools import combinations, pairwise

import numpy as np

from cellwright.circuits.circuit import member_named
from cellwright.circuits.temperature import ZERO_CELSIUS_KELVIN, resistance_factor
from cellwright.identification.columns import Data, Held
from cellwright.identification.condition import condition_of
from cellwright.identification.regression import SCALES, pull_of, solved
from cellwright.identification.search import (
    cheapest,
    cost_of,
    key_of,
    lowest,
    once,
    refined,
    settled,
    shared_of,
    system_about,
)
from cellwright.numerics.linear import solve
from cellwright.numerics.lines import FARADAY, GAS_CONSTANT
from cellwright.records.conditions import at_rest
from cellwright.records.counting import counted_std_share
from cellwright.records.thinning import edge_ampere, edges, thin, without_edges
from cellwright.refusal import Refusal

GRID_PER_DECADE = 4
SHORTEST_SECOND = 0.05  # time constant that is searched
FEWEST_ROWS = 20  # of a stretch that tells a relaxation
DIFFUSION_SECOND = (500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0)  # radius² over diffusivity


def data_of(
    records,
    ocv_volt,
    *,
    capacity_ampere_hour,
    hold="first_order",
    spacing=0.05,
    knots=None,
    capacity_std_ampere_hour=None,
):
    """Data of an identification: thinned records without edges, SoC knots, OCV table.

    Parameters
    ----------
    records : sequence of Record, each starting from rest.
    ocv_volt : (p,) OCV table on an even grid of SoC from 0 to 1 [V].
    hold : "zero_order" or "first_order" hold of the current between samples.
    capacity_ampere_hour : what the SoC refers to [Ah].
    spacing : distance of the knots from 20 % SoC on [1]; below they are denser.
    knots : (k,) SoC of the courses [1]; None: laid by `spacing` over the range of the data.
    capacity_std_ampere_hour : standard deviation of the capacity [Ah]; None: nothing tells it.

    Returns
    -------
    data : columns.Data.

    Raises
    ------
    Refusal : the current never changes: nothing excites the cell.
    """
    ready = ready_records(records, capacity_ampere_hour=capacity_ampere_hour)
    soc = np.concatenate([r.soc[r.used] for r in ready])
    if not len(soc):
        raise Refusal("no row of the records is left to fit")
    if knots is None:
        low, high = soc.min(), soc.max()
        # Near empty everything changes fast with the SoC.
        grid = np.append(
            (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.15), np.arange(0.2, 1.0 + spacing / 2, spacing)
        )
        inner = grid[(grid > low + 0.01) & (grid < high - 0.01)]
        knots = np.array([low, *inner, high]) if high > low else np.array([low])
    return Data(
        ready,
        np.asarray(knots, float),
        np.asarray(ocv_volt, float),
        hold,
        capacity_ampere_hour,
        kept={},
        counted_std=_counted_std(records, capacity_ampere_hour, capacity_std_ampere_hour),
    )


def _counted_std(records, capacity_ampere_hour, capacity_std_ampere_hour):
    """Standard deviation of capacity and counted charge, relative [1]; NaN where not known.

    One instrument counts all records of a cell: its errors are alike in them.
    """
    if capacity_std_ampere_hour is None:
        return np.nan
    share = {"capacity_ampere_hour": capacity_ampere_hour}
    counted = np.mean([counted_std_share(record, **share) for record in records])
    return float(np.hypot(capacity_std_ampere_hour / capacity_ampere_hour, counted))


def ready_records(records, *, capacity_ampere_hour):
    """Records with their steady stretches thinned and the rows at edges of the current left out.

    Of long loads without pulses or drives beside them a row is kept at each half per cent of the
    SoC as well: they alone tell how the resistance changes with it.

    Parameters
    ----------
    records : sequence of Record. capacity_ampere_hour : what their SoC refers to [Ah].

    Returns
    -------
    ready : tuple of Record.

    Raises
    ------
    Refusal : one current in all of them: nothing excites the cell.
    """
    current = np.concatenate([record.current_ampere for record in records])
    # Currents that differ by less than a twentieth tell OCV and resistance not apart.
    if np.ptp(current) <= 0.05 * np.abs(current).max(initial=0.0):
        raise Refusal("the current never changes: resistance cannot be told from OCV")
    step = max(edge_ampere(record) for record in records)
    along = {"capacity_ampere_hour": capacity_ampere_hour}
    if any(record.kind != "capacity" for record in records):
        along = {}
    thinned = [thin(record, step_ampere=step / 10, **along) for record in records]
    return tuple(without_edges(record, step_ampere=step) for record in thinned)


def identify(
    data,
    member,
    *,
    capacity_ampere_hour,
    celsius=25.0,
    limits_second=None,
    series=None,
    diffusion_second=None,
    shared=None,
):
    """Fit one member of the family to the records of one temperature.

    Parameters
    ----------
    data : columns.Data, from `data_of`.
    member : circuit.Member.
    capacity_ampere_hour : of the cell; sets the charge constants that are tried [Ah].
    celsius : temperature of the condition, for the scale of the kinetics [degC].
    limits_second : shortest and longest time constant [s]; None: what the data can show.
    series : number of time constants of a fixed series; None: `series_of` the limits.
    diffusion_second : diffusion time to hold where the member has one [s]; None: the best of a few.
    shared : search.Shared of the data, where several members are fitted to them; None: made here.

    Returns
    -------
    fitted : search.Fit with its condition.

    Raises
    ------
    Refusal : nothing excites the cell, or the data cannot carry the parameters.

    Source: thesis 2.3 (2.17–2.20), with a deterministic search in place of its genetic one.
    """
    # ASSUME: OCV at a test's temperature and direction is the slow test's curve plus a shift over
    # SoC, and a capacity within a few per cent, fitted with the resistances from fitted data only.
    # ASSUME: Time constants of a cell do not depend on SoC, its resistances do (linear between).
    shared = shared or shared_of(data)
    low, high = limits_of(data) if limits_second is None else limits_second
    start = once(
        shared,
        (member.pairs, low, high, series),
        # A member without its other parts, from which its search begins.
        lambda: settled(shared, Held(tuple(_taus(shared, member, low, high, series)))),
    )
    held, factor = start.held, start.solution.factor
    for name, values in _candidates(
        member, capacity_ampere_hour, celsius, diffusion_second
    ).items():
        tries = [held._replace(**{name: value}) for value in values]
        key = (*map(key_of, tries), factor)
        held = once(shared, key, lambda tries=tries: cheapest(shared, tries, factor))
    fit = start if held == start.held else settled(shared, held)
    bounds = None if member.pairs is None else (low, high)
    if member.pairs:
        fit = refined(shared, fit, bounds)
    return fit._replace(condition=condition_of(shared, member, fit, bounds))


def _candidates(member, capacity_ampere_hour, celsius, diffusion_second):
    """Values to try for each held number of a member, None (absent) first.

    Diffusion that was found at one temperature is there at all of them.
    """
    thermal = 2 * GAS_CONSTANT * (celsius + ZERO_CELSIUS_KELVIN) / FARADAY
    diffusions = (None, *DIFFUSION_SECOND) if diffusion_second is None else (diffusion_second,)
    charges = [share * capacity_ampere_hour for share in (0.01, 0.03, 0.1, 0.3)]
    choices = {
        "scale_volt": member.kinetic and [None, *(n * thermal for n in (1, 2))],
        "diffusion_second": member.diffusion and diffusions,
        "charge_ampere_hour": member.hysteresis and [None, *charges],
    }
    return {name: values for name, values in choices.items() if values}


def limits_of(data):
    """Shortest and longest time constant that records resolve [s].

    A relaxation is told from what changes with the SoC only while this stands still: in a rest
    after a load, or in a load for as long as it passes no more than lies between two knots. Of a
    slower one all rows together tell no more than a shift and a scale of the OCV. Where nothing
    rests, the longest steady load is all that there is; the deviations then say what it tells.

    Parameters
    ----------
    data : columns.Data.

    Returns
    -------
    low_second, high_second : [s].
    """
    sampling = []
    for record in data.records:
        steps = np.diff(record.test_time_second)
        sampling.append(np.percentile(steps[steps > 0], 10))
    low = min(sampling)
    whole, still, rest = np.max([_longest_second(data, record) for record in data.records], axis=0)
    high = still if rest > FEWEST_ROWS * low else whole
    return max(low, SHORTEST_SECOND), max(high, FEWEST_ROWS * low)


def _longest_second(data, record):
    """Longest time of a record between two steps of the current: as such, while the SoC moves by
    no more than lies between two knots, and in a rest after a load; (3,) [s]."""
    time, soc = record.test_time_second, record.soc
    apart_soc = np.diff(data.knots).max(initial=0.0)
    step = max(edge_ampere(record), 1e-9)
    marks = np.unique(np.r_[0, edges(record, step_ampere=step), len(soc) - 1])
    parts = [slice(begin, end + 1) for begin, end in pairwise(marks)]
    whole = [np.ptp(time[part]) for part in parts]
    still = [_still_second(time[part], soc[part], apart_soc) for part in parts]
    resting = [
        at_rest(np.median(record.current_ampere[part]), data.capacity_ampere_hour)
        for part in parts[1:]
    ]
    rests = [second for second, rested in zip(whole[1:], resting, strict=True) if rested]
    return [max(seconds, default=0.0) for seconds in (whole, still, rests)]


def _still_second(time, soc, apart_soc):
    """Longest time [s] within a stretch in which the SoC, which goes one way, moves no further."""
    passed = np.maximum.accumulate(np.abs(soc - soc[0]))
    # Where the SoC stands, the latest time at which it does.
    reached, last = np.unique(passed[::-1], return_index=True)
    until = np.interp(passed + apart_soc, reached, time[::-1][last])
    return float((until - time).max())


def series_of(low_second, high_second):
    """Number of time constants of a series: two a decade, closer neighbours look alike to data.

    Parameters
    ----------
    low_second, high_second : shortest and longest time constant [s].
    """
    return max(round(np.log10(high_second / low_second) * 2), 2)


def _taus(shared, member, low, high, series):
    if member.pairs is None:
        return np.geomspace(2 * low, high, series or series_of(low, high))
    if member.pairs == 0:
        return ()
    count = round(np.log10(high / low) * GRID_PER_DECADE)
    grid = np.geomspace(low, high, max(count, member.pairs + 1))
    *normal, factor = once(shared, tuple(grid), lambda: _weighted_grid(shared, grid))
    start = _best_on_grid(*normal, grid, member.pairs, len(shared.data.knots))
    return _pattern_search(shared, start, low, high, factor)


def _weighted_grid(shared, grid):
    """Normal equations of all time constants of a grid: Gram matrix, moment, weight of the data."""
    system = system_about(shared, Held(tuple(grid)))
    factor = solved(system).factor
    gram = factor * system.gram + system.prior
    return gram, factor * system.moment - pull_of(system), factor


def _best_on_grid(gram, moment, grid, pairs, count):
    """Combination of grid time constants with the lowest cost [s]; one system serves all.

    Without its bounds no combination costs more than with them. So they are tried in the order of
    that cost, which all together take little, until it exceeds the best of those tried.
    """
    first, combined = 2 * count + SCALES, list(combinations(range(len(grid)), pairs))
    rows = [
        np.concatenate([np.arange(first), *(first + n * count + np.arange(count) for n in chosen)])
        for chosen in combined
    ]
    portions = [np.array(rows[k : k + PORTION]) for k in range(0, len(rows), PORTION)]
    unbound = np.concatenate([_unbound_costs(gram, moment, some) for some in portions])
    best, cost = None, np.inf
    for place in np.argsort(unbound, kind="stable"):
        if unbound[place] >= cost:
            break
        part, right = gram[np.ix_(rows[place], rows[place])], moment[rows[place]]
        vector = solve(part, right, count + SCALES)
        trial = vector @ part @ vector - 2 * vector @ right
        if trial < cost:
            best, cost = grid[list(combined[place])], trial
    return best


PORTION = 100  # combinations solved at once: their matrices are in memory together


def _unbound_costs(gram, moment, rows):
    """Lowest cost of each of some choices of parameters (c, p), were they all without a bound."""
    right = moment[rows]
    vectors = np.linalg.solve(gram[rows[:, :, None], rows[:, None, :]], right[:, :, None])[:, :, 0]
    return -np.sum(vectors * right, axis=1)


def _pattern_search(shared, start, low, high, factor):
    """Time constants [s] by pattern search on their logarithms from the best on the grid."""
    log_tau, step = np.log(start), np.log(10) / GRID_PER_DECADE / 2
    best = cost_of(shared, Held(tuple(start)), factor)
    # A fiftieth of a time constant is less than its deviation ever is.
    while step > 0.02:
        moves = [log_tau + sign * step * unit for unit in np.eye(len(log_tau)) for sign in (1, -1)]
        moves = [np.clip(np.sort(move), np.log(low), np.log(high)) for move in moves]
        costs = [cost_of(shared, Held(tuple(np.exp(move))), factor) for move in moves]
        if min(costs) < best:
            best, log_tau = min(costs), moves[int(np.argmin(costs))]
        else:
            step /= 2
    return tuple(np.exp(log_tau))


PLAIN = member_named("DRT+D")
PROMPT_SECOND = 60.0  # what relaxes within it pulses tell
TRIED_JOULE_PER_MOLE = (0.0, 10e3, 20e3, 30e3, 40e3, 50e3)


def activation_of(by_temperature, data_of_records, *, capacity_ampere_hour):
    """Activation energy of the resistances at each temperature.

    With several temperatures the slope of ln R over 1/T to the neighbours, R being what relaxes
    within a minute, at the middle of the common SoC. With one, the value among 0, 10, … 50 kJ/mol
    that fits best, provided the cell warmed by more than 2 K.

    Parameters
    ----------
    by_temperature : list of FitRecords, ascending in temperature.
    data_of_records : function (FitRecords) → regression.Data.
    capacity_ampere_hour : [Ah].

    Returns
    -------
    joule_per_mole : list, one a temperature [J/mol], None where nothing tells it. words : sentence
        on them, or "".
    """
    if len(by_temperature) > 1:
        resistance = [
            _resistance(data_of_records(fit_records), fit_records, capacity_ampere_hour)
            for fit_records in by_temperature
        ]
        celsius = [fit_records.celsius for fit_records in by_temperature]
        energies = _energies_from_neighbours(celsius, resistance)
        if None in energies:
            return energies, ""
        pairs = zip(celsius, energies, strict=True)
        listed = ", ".join(f"{energy / 1e3:.0f} at {t:g} °C" for t, energy in pairs)
        return energies, f"activation energies from neighbouring temperatures: {listed} kJ/mol"
    varied = max(np.ptp(record.celsius) for record in by_temperature[0].records)
    # Less is a chamber's wobble, in which no resistance shows its energy.
    if varied < 2.0:
        return [None], ""
    try:
        best = _best_energy(by_temperature[0], data_of_records, capacity_ampere_hour)
    except Refusal as refusal:
        return [None], f"activation energy not known, fitted without one: {refusal}"
    words = f"activation energy {best / 1e3:.0f} kJ/mol, from the cell's own warming"
    return [best], f"{words} by {varied:.0f} K"


def at_activation_energy(fit_records, joule_per_mole):
    """The records of a temperature with the factor on their resistances at an activation energy.

    Parameters
    ----------
    fit_records : FitRecords.
    joule_per_mole : activation energy [J/mol].
    """
    records = tuple(
        record._replace(
            resistance_factor=resistance_factor(record.celsius, fit_records.celsius, joule_per_mole)
        )
        for record in fit_records.records
    )
    return fit_records._replace(records=records)


def _resistance(data, fit_records, capacity):
    """Resistance at half charge [ohm], NaN where too little was measured to fit one."""
    try:
        fitted = identify(data, PLAIN, capacity_ampere_hour=capacity, celsius=fit_records.celsius)
    except Refusal:
        return np.nan
    condition = fitted.condition
    return float(np.interp(0.5, condition.soc, prompt_resistance(condition)))


def prompt_resistance(condition):
    """Ohmic resistance and what relaxes within a minute at the knots (k,) [ohm].

    Slower parts are poorly known.

    Parameters
    ----------
    condition : Condition.
    """
    pairs = [branch.values for branch in condition.branches if branch.kind == "RC"]
    fast = [values["r_ohm"] for values in pairs if values["tau_second"][0] <= PROMPT_SECOND]
    return sum(fast, condition.r0_ohm)


def _energies_from_neighbours(celsius, resistance):
    """Activation energy at each temperature [J/mol]: mean slope to its neighbours, or None."""
    resolved = np.isfinite(resistance)
    if resolved.sum() < 2:
        return [None] * len(celsius)
    temperature, ohm = np.asarray(celsius)[resolved], np.asarray(resistance)[resolved]
    slope = GAS_CONSTANT * np.diff(np.log(ohm)) / np.diff(1.0 / (temperature + ZERO_CELSIUS_KELVIN))
    slope = np.clip(slope, 0.0, 100e3)
    means = [np.mean(slope[max(k - 1, 0) : k + 1]) for k in range(len(temperature))]
    return np.interp(celsius, temperature, means).tolist()


def _best_energy(fit_records, data_of_records, capacity):
    """Activation energy of the lowest cost among those that are tried [J/mol].

    The residuals are nearly linear in the energy, so that their square is nearly a parabola, which
    falls to its lowest and rises from there: energies are tried from the middle on in the direction
    in which it falls, until it rises. All costs are at the weight of the data without an energy.
    """

    @cache
    def fitted(number):
        records = at_activation_energy(fit_records, TRIED_JOULE_PER_MOLE[number])
        shared = shared_of(data_of_records(records))
        settings = {"capacity_ampere_hour": capacity, "celsius": fit_records.celsius}
        return shared, identify(shared.data, PLAIN, shared=shared, **settings)

    factor = fitted(0)[1].solution.factor

    def cost(number):
        shared, fit = fitted(number)
        return cost_of(shared, fit.held, factor)

    # From the middle on.
    return TRIED_JOULE_PER_MOLE[lowest(cost, len(TRIED_JOULE_PER_MOLE), start=3)]
