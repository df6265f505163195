"""Intervals of a simulated voltage: between which bounds nine of ten samples lie.

What a model misses shows in blocks left out of its fit. It grows with what they grow with: what
acts at once and what lasts of the overvoltage, the slope of the OCV, and how far the other kind of
model, circuit or particle, which was fitted to the same records, says something else. The shares
are those under which the half width holds nine of ten rows that were left out. What those rows
cannot show is added as it is stated: SoC at the start and counted, the core of the cell, and what a
particle's fit leaves open of its parameters.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from cellwright.circuits.model_file import in_use, simulate_model
from cellwright.circuits.particle import LAGS, of_document
from cellwright.circuits.particle import NAME as PARTICLE
from cellwright.circuits.particle import run as run_particle
from cellwright.circuits.temperature import continued_ocv_at, temperature_weights
from cellwright.identification.messages import say
from cellwright.numerics.lags import lag
from cellwright.numerics.statistics import NORMAL_90
from cellwright.records.conditions import (
    SAME_RATE,
    at_rest,
    at_rest_in_record,
    same_temperature,
)
from cellwright.records.counting import counted_std_share
from cellwright.records.record import STATED
from cellwright.records.thinning import averaged_to
from cellwright.refusal import Refusal

HELD = 0.9  # of the rows
FEWEST_BLOCKS = 9  # n of whose n + 1 next ones HELD lie below the largest
# By what the half width grows, each a voltage: its factors are the names of the model file.
TERMS = ("reading_volt", "at_once_share", "lasting_share", "soc_error", "rival_share")
MISFIT_BINS = 20  # of SoC
MOST_ROWS = 4000  # that a half width is learnt from, and of a record that shows a posterior
SMALLEST_VOLT = 1e-9  # of a misfit of which another is a multiple
SIDE_SOC = 0.01  # to both sides, over which the slope of the OCV is taken
# ASSUME: The mean of a cell is warmer than its surface by up to P/(8 π k L), a cylinder that
# heats evenly: 1.2 K/W for 65 mm at 0.5 W/m/K, less in proportion where the cell is larger; it
# follows the heat within r²/(5.8 a), 100 s at a radius of 10 mm.
CORE_KELVIN_PER_WATT, CORE_AMPERE_HOUR, CORE_SECOND = 1.2, 2.9, 100.0


def simulated(model, member, record):
    """A member of a model simulated through a record, as the instrument reads it.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. member : its name. record : Record.

    Returns
    -------
    simulated : model_file.Simulated.
    """
    columns = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
    return simulate_model(model, member, *columns, kind=record.kind)


class Learnt(NamedTuple):
    """Rows that were left out: how far each was missed, by what that may grow, and its weight.

    missed_volt, weight : (n,). sizes_volt : (terms, n), see `sizes`. blocks : how many.
    misfit_volt : (3, MISFIT_BINS) mean error in the fit on discharge, at rest and on charge in bins
        of SoC, NaN where there is no row: two models that miss alike there miss alike elsewhere.
    """

    missed_volt: np.ndarray
    sizes_volt: np.ndarray
    weight: np.ndarray
    blocks: int
    misfit_volt: np.ndarray


def with_intervals(model, conditions):
    """The model with what it was fitted to and the intervals of its voltage.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, finished, with `left_out`.
    conditions : list of lists of FittedRecord, from `in_use.fitted_records`.

    Returns
    -------
    model : the same with `fitted_to`, the limits of each condition's records, `intervals`, one a
        model that is used (what predicts best, and the chosen member), and a note on one that has
        none.
    """
    celsius = [entry["ambient_temperature_celsius"] for entry in model["left_out"]]
    fitted = [
        {"ambient_temperature_celsius": at} | _limits([one.record for one in condition])
        for at, condition in zip(celsius, conditions, strict=True)
    ]
    intervals, notes = [], []
    for name in dict.fromkeys((in_use(model), model["chosen"])):
        try:
            intervals.append(_interval(model, name, conditions))
        except Refusal as refusal:
            notes.append(say("intervals.none", name=name, refusal=refusal))
    return model | {
        "fitted_to": fitted,
        "intervals": intervals,
        "notes": [*model.get("notes", ()), *notes],
    }


def _limits(records):
    """Least and largest SoC [1], largest current [A] of the rows that a condition was fitted to."""
    soc, ampere = (
        np.concatenate([getattr(record, name)[record.used] for record in records])
        for name in ("soc", "current_ampere")
    )
    return {"soc": [float(soc.min()), float(soc.max())], "most_ampere": float(np.abs(ampere).max())}


def _interval(model, name, conditions):
    """Entry of a model in `intervals`; `alone`, its shares where nothing but it is simulated.

    Raises Refusal: too few blocks were left out.
    """
    rival = rival_of(model, name)
    learnt = _left_out_rows(model, name, rival, conditions)
    factors = shares_holding(learnt.missed_volt, learnt.sizes_volt, learnt.weight)
    alone = shares_holding(learnt.missed_volt, learnt.sizes_volt[:-1], learnt.weight)
    return {
        "model": name,
        "rival": rival,
        **dict(zip(TERMS, factors.tolist(), strict=True)),
        "alone": alone.tolist(),
        "start_soc_std": _start_std(model),
        "blocks": learnt.blocks,
        "misfit_volt": [
            [float(v) if np.isfinite(v) else None for v in way] for way in learnt.misfit_volt
        ],
    }


def rival_of(model, name):
    """Name of the other kind of model of the same records; None where there is no other.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. name : of what is in use.
    """
    if name == PARTICLE:
        return model["chosen"]
    return PARTICLE if model.get("particle") else None


def _start_std(model):
    """Deviation of the SoC at the start of a test [1]: by which the full charges before the tests
    fitted differ from one temperature to the next. Of a circuit that trades with the shift of its
    OCV, so the particle tells it; 0 where there is none, or fewer than three temperatures. A load
    alone, at a temperature of which nothing else is fitted, does not tell it from the stretch."""
    particle = model.get("particle") or {"missing": (), "celsius": ()}
    tested = [table["ambient_temperature_celsius"] for table in model["ocv"]]
    missing = [
        soc
        for soc, celsius in zip(particle["missing"], particle["celsius"], strict=True)
        if any(same_temperature(celsius, other) for other in tested)
    ]
    return float(np.std(missing, ddof=1)) if len(missing) > 2 else 0.0


def _left_out_rows(model, name, rival, conditions):
    """Learnt of a model: its rows as simulated in use, each missed by as much more as a drive is.

    A block that takes part in a fit of leverage h is missed by σ√(1 − h), left out by σ/√(1 − h);
    a drive, which takes no part beside it, by σ√(1 + h). A drive hardly rests, an HPPC hardly does
    anything else: rows at rest and under load weigh alike.

    Source: R. D. Cook, S. Weisberg, Residuals and Influence in Regression (1982), 2.1.
    """
    parts, blocks, capacity = [], 0, model["capacity_ampere_hour"]
    binned = np.zeros((2, 3 * MISFIT_BINS))
    for number, condition in enumerate(conditions):
        rms_volt = _left_out_rms(model, name, number)
        if not len(rms_volt):
            continue
        pairs = [_errors_and_sizes(model, name, rival, one.record) for one in condition]
        error, size = (np.concatenate(of, axis=-1) for of in zip(*pairs, strict=True))
        place = np.concatenate([_bin_of(one.record) for one in condition])
        binned += [np.bincount(place, of, 3 * MISFIT_BINS) for of in (error, np.ones(len(error)))]
        block = np.concatenate([one.block for one in condition])
        of_block = np.unique(block, return_inverse=True)[1]
        in_fit = np.sqrt(np.bincount(of_block, error**2) / np.bincount(of_block))
        grown = np.maximum(rms_volt / np.maximum(in_fit, SMALLEST_VOLT), 1.0)
        missed = np.abs(error) * np.sqrt(2.0 * grown - 1.0)[of_block]
        current = np.concatenate([one.record.current_ampere[one.record.used] for one in condition])
        kept = slice(None, None, -(-len(missed) * len(conditions) // MOST_ROWS))
        resting = at_rest(current[kept], capacity).astype(int)
        weight = 1.0 / np.bincount(resting, minlength=2)[resting]
        parts.append((missed[kept], size[:, kept], weight / weight.sum()))
        blocks += len(rms_volt)
    # Of fewer none shows by how much one of ten is missed.
    if blocks < FEWEST_BLOCKS:
        raise Refusal(f"{blocks} blocks were left out of the fit; wanted {FEWEST_BLOCKS} or more")
    total, rows = binned
    misfit = np.divide(total, rows, out=np.full(len(rows), np.nan), where=rows > 0)
    learnt = (np.concatenate(of, axis=-1) for of in zip(*parts, strict=True))
    return Learnt(*learnt, blocks, misfit.reshape(3, MISFIT_BINS))


def _bin_of(record):
    """Place of each used row of a record in `misfit_volt` (used rows,)."""
    current = np.where(at_rest_in_record(record.current_ampere), 0.0, record.current_ampere)
    way = 1 + np.sign(current[record.used]).astype(int)
    at = np.clip((record.soc[record.used] * MISFIT_BINS).astype(int), 0, MISFIT_BINS - 1)
    return way * MISFIT_BINS + at


def _errors_and_sizes(model, name, rival, record):
    """Error (used rows,) of a simulation of a record that was fitted [V], and its `sizes`."""
    run = simulated(model, name, record)
    rival_volt = None if rival is None else simulated(model, rival, record).voltage_volt
    error = (record.voltage_volt - run.voltage_volt)[record.used]
    return error, sizes(model, name, record, run, rival_volt)[:, record.used]


def _left_out_rms(model, name, number):
    """Rms error of each block of a condition when it was left out of the fit (b,) [V]."""
    if name == PARTICLE:
        square, _ = model["particle"]["left_out"][number]
    else:
        square = model["left_out"][number]["square_volt2"].get(name, ())
    return np.sqrt(np.asarray(square, float))


def sizes(model, name, record, run, rival_volt):
    """By what the error of a simulation may grow, (terms, n) in the order of `TERMS`.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. name : of what was simulated.
    record : Record (n,). run : model_file.Simulated of it.
    rival_volt : (n,) by the other kind of model [V], None where there is none.

    Returns
    -------
    sizes : one; what acts at once and what lasts of the overvoltage [V]; slope of the OCV [V];
        how far the other kind of model is off [V].
    """
    over = run.overpotential_volt
    # Of a circuit what is ohmic; of a particle all but its diffusion and its slow lags.
    at_once = over[: -len(LAGS) + 1].sum(axis=0) if name == PARTICLE else over[0]
    table = continued_ocv_at(model["ocv"], record.soc, record.celsius)
    lasting = run.voltage_volt - table - at_once
    apart = np.zeros(len(table)) if rival_volt is None else run.voltage_volt - rival_volt
    return np.abs([np.ones(len(table)), at_once, lasting, _slope(model, record), apart])


def _slope(model, record):
    """Slope of the OCV at the counted SoC of a record (n,) [V]; at the ends that within."""
    middle = np.clip(record.soc, SIDE_SOC, 1.0 - SIDE_SOC)
    above, below = (
        continued_ocv_at(model["ocv"], middle + side, record.celsius)
        for side in (SIDE_SOC, -SIDE_SOC)
    )
    return (above - below) / (2 * SIDE_SOC)


def shares_holding(missed_volt, sizes_volt, weight, *, held=HELD):
    """Factors, none below zero, of the sizes whose sum holds a share of the rows.

    Quantile regression; its linear programme is solved by the dual, which has a row a size.

    Parameters
    ----------
    missed_volt : (n,) size of the error [V]. sizes_volt : (terms, n). weight : (n,) of a row.
    held : share of the rows that the sum of the sizes times their factors is to hold.

    Returns
    -------
    factors : (terms,).

    Raises
    ------
    Refusal : values that are not finite.

    Source: R. Koenker, G. Bassett, Econometrica 46 (1978) 33.
    """
    if not (np.isfinite(missed_volt).all() and np.isfinite(sizes_volt).all()):
        raise Refusal("errors of what was left out are not finite; wanted numbers")
    weight = np.asarray(weight, float) / np.sum(weight)
    # Sizes of one order, and millivolts: the solver's tolerances are absolute.
    scale = np.maximum(np.average(sizes_volt, axis=1, weights=weight), 1e-12)
    limits = np.column_stack([-(1.0 - held) * weight, held * weight]) * len(weight)
    found = linprog(
        -1e3 * np.asarray(missed_volt),
        A_ub=sizes_volt / scale[:, None],
        b_ub=np.zeros(len(sizes_volt)),
        bounds=limits,
        method="highs-ds",
    )
    if not found.success:
        raise Refusal(f"no half width is found: {found.message}")
    return np.maximum(-1e-3 * found.ineqlin.marginals / scale, 0.0)


def half_width_volt(model, name, record, runs):
    """Half width of the interval that holds nine of ten samples of a simulation (n,) [V].

    Parameters
    ----------
    model : dict of schema cellwright-model/2. name : of what was simulated. record : Record (n,).
    runs : dict name → model_file.Simulated of all that the model can be simulated with.

    Returns
    -------
    half_volt : (n,) [V]; None where the model states no interval of it.
    """
    entries = [entry for entry in model.get("intervals", ()) if entry["model"] == name]
    if not entries:
        return None
    (entry,), run = entries, runs[name]
    rival = runs.get(entry["rival"])
    size = sizes(model, name, record, run, None if rival is None else rival.voltage_volt)
    learnt = np.array([entry[term] for term in TERMS]) @ size
    slope, capacity = _slope(model, record), model["capacity_ampere_hour"]
    share = counted_std_share(record, capacity_ampere_hour=capacity)
    passed = np.abs(record.soc - record.soc[0])
    counted = share * passed if np.isfinite(share) else 0.0
    stated = (
        slope * np.hypot(entry["start_soc_std"], counted),
        _of_core(model, name, record, run),
        _of_posterior(model, record) if name == PARTICLE else 0.0,
    )
    return np.sqrt(learnt**2 + NORMAL_90**2 * sum(std_volt**2 for std_volt in stated))


def _of_posterior(model, record):
    """Deviation of a particle's voltage by what its fit leaves open of its parameters (n,) [V].

    Blocks left out are of loads that were fitted: what only other loads would tell they do not
    show. Raises Refusal: a posterior of another particle.
    """
    particle = of_document(model["particle"])
    rows = model["particle"].get("posterior")
    if rows is None:
        return 0.0
    if [len(row) for row in rows] != list(range(1, len(particle.vector) + 1)):
        found = f"the particle's posterior has {len(rows)} rows"
        raise Refusal(f"{found}; wanted {len(particle.vector)}, each one longer than the last")
    root = np.zeros((len(rows), len(rows)))
    root[np.tril_indices(len(rows))] = np.concatenate(rows)
    (few,) = averaged_to([record], most_rows=MOST_ROWS)
    columns = few.test_time_second, few.current_ampere, few.soc, few.celsius
    size = {"capacity_ampere_hour": model["capacity_ampere_hour"]}
    by = run_particle(particle, *columns, **size, derivatives=True).by
    std_volt = np.linalg.norm(by @ root, axis=1)
    return np.interp(record.test_time_second, few.test_time_second, std_volt)


def _of_core(model, name, record, run):
    """Deviation of the voltage by the core of a cell, which no surface tells (n,) [V].

    Where the chamber stands for the cell, what it warms by took part in the fit as well.
    """
    if record.temperature_source in STATED:
        return 0.0
    capacity = model["capacity_ampere_hour"]
    table = continued_ocv_at(model["ocv"], record.soc, record.celsius)
    watt = np.maximum(record.current_ampere * (run.voltage_volt - table), 0.0)
    steps = np.diff(record.test_time_second)
    kelvin_per_watt = CORE_KELVIN_PER_WATT * CORE_AMPERE_HOUR / capacity
    rise = kelvin_per_watt * lag(steps, CORE_SECOND, watt, hold="first_order")
    warmer = simulated(model, name, record._replace(celsius=record.celsius + rise))
    return np.abs(warmer.voltage_volt - run.voltage_volt)


class Fitted(NamedTuple):
    """What a model was fitted to at the temperature of each sample: least and largest SoC [1], and
    the largest current either way [A]; (n,) each."""

    low_soc: np.ndarray
    high_soc: np.ndarray
    most_ampere: np.ndarray


def fitted_at(model, celsius):
    """What a model was fitted to along a temperature; None where it does not say.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. celsius : (n,) [°C].
    """
    entries = model.get("fitted_to")
    if not entries:
        return None
    measured = np.array([entry["ambient_temperature_celsius"] for entry in entries], float)
    limits = np.array([[*entry["soc"], entry["most_ampere"]] for entry in entries])
    return Fitted(*(limits.T @ np.array(temperature_weights(measured, celsius))))


def beyond(model, record, run):
    """Which samples of a simulation lie beyond what its model was fitted to, by what.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. record : Record (n,). run : Simulated of it.

    Returns
    -------
    beyond : dict of (n,) bool: `soc`, `temperature`, `rate`, and `below`, the part of `soc` that
        lies towards empty.
    """
    soc, fitted = run.extrapolated, fitted_at(model, record.celsius)
    below = soc & (record.soc < 0.5)
    rate = np.zeros(len(soc), bool)
    if fitted is not None:
        below = below | (record.soc < fitted.low_soc)
        soc = soc | below | (record.soc > fitted.high_soc)
        rate = np.abs(record.current_ampere) > SAME_RATE * fitted.most_ampere
    return {"soc": soc, "temperature": run.outside_temperature, "rate": rate, "below": below}
