"""Filters through a test that took no part in any fit, from wrong starts, and their scores."""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.instrument import words_of
from cellwright.circuits.model_file import member_of
from cellwright.filters.bank import hysteresis_of, loaded_mean
from cellwright.filters.estimate import Estimate, Start, estimate_on, with_doubt_of_capacity
from cellwright.filters.learnt import as_filtered, learnt_at
from cellwright.filters.plant import ERROR, Noise, look_at, piece_of, plant_of, with_tracked
from cellwright.filters.reference import reference_of
from cellwright.numerics.statistics import NORMAL_95, rms
from cellwright.records import inputs
from cellwright.records.filled import silent_loads
from cellwright.records.thinning import rows_of
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Soc

LAGS = 20  # of the autocorrelation that is tested
CONVERGED_SOC, HELD_SECOND = 0.03, 600.0  # a filter has converged when its error stays this small
WINDOW_SECOND = 600.0  # of the adaptive law
# Starts and scenarios are a yardstick: of one size everywhere, so that cells and members compare.
START_ERROR = -0.3  # of the SoC; also runs through every scenario
START_STD = 0.5  # that a filter is told of its start: it knows nothing of it
OFFSET_C_RATE = 0.01  # of the current, over the capacity: a poor sensor's
BIAS_VOLT = 0.005  # of the voltage: a poor sensor's
CAPACITY_ERROR = 0.1  # relative: half a life
NUMBERS = ("nis_mean", "nis_low", "nis_high", "autocorrelation")  # of the innovations


def innovation_tests(innovation_volt, innovation_std_volt):
    """Normalised innovation squared against χ², and whiteness.

    Parameters
    ----------
    innovation_volt, innovation_std_volt : (n,) [V].

    Returns
    -------
    tests : dict; NaN and False where a method has no innovations. nis_mean : mean of the squares of
        the innovations over what they should be; one where the filter's noise is right, larger
        where it trusts its model too much. nis_low, nis_high : where it lies in 95 % of such
        records. autocorrelation : of neighbours; zero where nothing is left to learn. white :
        whether the Ljung–Box statistic over `LAGS` lags stays below its 95 % bound.

    Raises
    ------
    Refusal : fewer samples than lags.

    Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications (2001) 5.4;
        G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297.
    """
    ratio = innovation_volt / innovation_std_volt
    if np.isnan(ratio).all():
        return dict.fromkeys(NUMBERS, np.nan) | {"white": False}
    n = len(ratio)
    if n <= LAGS:
        raise Refusal(f"{n} innovations; more than {LAGS} are needed to test them")
    low, high = (chi_square(side, n) / n for side in (-NORMAL_95, NORMAL_95))
    centred = ratio - ratio.mean()
    power = max(centred @ centred, np.finfo(float).tiny)
    rho = np.array([centred[k:] @ centred[:-k] / power for k in range(1, LAGS + 1)])
    statistic = n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, LAGS + 1)))
    white = bool(statistic < chi_square(1.644853627, LAGS))
    numbers = float(np.mean(ratio**2)), low, high, float(rho[0])
    return dict(zip(NUMBERS, numbers, strict=True)) | {"white": white}


def chi_square(normal, degrees):
    """Quantile of χ² at the probability that a standard normal variable has at `normal`.

    Parameters
    ----------
    normal : quantile of the standard normal distribution.
    degrees : degrees of freedom.

    Source: E. B. Wilson, M. M. Hilferty, PNAS 17 (1931) 684; within 0.6 % from 20 degrees up.
    """
    ninth = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - ninth + normal * np.sqrt(ninth)) ** 3)


def convergence_second(test_time_second, error_soc, *, band=CONVERGED_SOC, hold_second=HELD_SECOND):
    """Time until the error is within a band and stays there for a while.

    Parameters
    ----------
    test_time_second, error_soc : (n,) [s], [1].
    band : largest error that counts as converged [1].
    hold_second : for how long it has to stay there [s].

    Returns
    -------
    second : time since the first sample [s]; NaN where it never does.
    """
    inside = np.abs(error_soc) <= band
    bounds = np.flatnonzero(np.diff(inside.astype(int), prepend=0, append=0))
    first, last = bounds[::2], bounds[1::2] - 1
    stays = test_time_second[last] - test_time_second[first] >= hold_second
    if not stays.any():
        return np.nan
    return float(test_time_second[first[stays][0]] - test_time_second[0])


def scores(test_time_second, estimate, reference, scored, *, scale_share=0.0):
    """Errors of an estimated SoC against a reference, as far as that may not be wrong by them.

    Parameters
    ----------
    test_time_second : (n,) [s].
    estimate : estimate.Estimate.
    reference : reference.Reference.
    scored : (n,) bool, the samples that count.
    scale_share : deviation of the scale that estimate and reference share [1]; in soc_std alone.

    Returns
    -------
    row : dict. rmse_soc and max_abs_soc are taken after convergence, or over all that counts where
        there is none; coverage_95 is the share of samples whose 95 % interval meets that of the
        reference, all of them. counted_rmse_soc : as rmse_soc, against the count as it is.

    Raises
    ------
    Refusal : no sample counts, or an estimate that is not finite.
    """
    error = reference.beyond(estimate.soc)
    if not scored.any():
        raise Refusal("no sample is left to score")
    if not np.isfinite(error).all():
        raise Refusal(f"{np.sum(~np.isfinite(error))} estimated SoC are not finite")
    time = test_time_second
    converged = convergence_second(time, error)
    late = scored & (time - time[0] >= (0.0 if np.isnan(converged) else converged))
    late = late if late.any() else scored
    covered = np.abs(error) <= NORMAL_95 * estimate.std
    tests = innovation_tests(estimate.innovation_volt[scored], estimate.innovation_std_volt[scored])
    return {
        "rmse_soc": rms(error[late]),
        "counted_rmse_soc": rms((estimate.soc - reference.soc)[late]),
        "max_abs_soc": float(np.abs(error[late]).max()),
        "convergence_second": converged,
        "capacity_ampere_hour": float(estimate.capacity_ampere_hour[-1]),
        "capacity_std_ampere_hour": float(estimate.capacity_std_ampere_hour[-1]),
        "soc_std": float(with_doubt_of_capacity(estimate, scale_share).std[late].mean()),
        "coverage_95": float(covered[scored].mean()),
        **tests,
    }


FEWEST, MOST = 20, 20000  # samples of the window of the adaptive law
WALK_RATIO = 10.0  # of the largest to the smallest variance that the current sensor adds


def estimate_soc(model, record, settings=None, **changes):
    """State of charge [1] over a test by every filter, from wrong starts, with its error.

    The first stated error of the start is run with every scenario; further errors and starts
    nominally only.

    model, record : of `held_out`.
    settings : `settings.Soc`, its keys such as filters and initial_soc_error.

    Returns rows, one a filter, start and scenario: rmse_soc, max_abs_soc [1], convergence_second
    [s]; series: (n,) estimates of the first start. Raises Refusal: nothing is left to score, or an
    unknown filter. Source: thesis 2.4; docs/soc-filters.md.
    """
    settings, model = inputs.settings_of(Soc, settings, changes), given.model(model)
    size, entry = model["capacity_ampere_hour"], member_of(model, None)
    celsius = loaded_mean(record.current_ampere, record.celsius, size)
    bank, record, hold = as_filtered(model, None, record)
    source = record.temperature_source
    place = f"{celsius:.1f} °C, the mean under load of {source} temperature"
    notes = [f"filters use the parameters at {place}"]
    blocks = ("reading", "counting")
    notes += [
        f"filters and their reference know that {sentence}" for sentence in words_of(entry, blocks)
    ]
    usual = noise_of(settings, record.test_time_second)
    noises = {
        method: usual._replace(**learnt_at(entry, celsius, capacity_known=method != "dual"))
        for method in dict.fromkeys((*settings.filters, "dual"))
    }
    notes += _noise_in_words(usual._replace(**learnt_at(entry, celsius)), usual)
    unsure = (model.get("capacity_std_ampere_hour") or 0.0) / size
    curve = {"soc": bank.soc, "ocv_volt": bank.ocv_volt + bank.shift_volt}
    # A cell rests anywhere between its branches, however exact the count.
    reference = reference_of(record, curve | {"half_gap_volt": hysteresis_of(bank)})
    first, *others = _starts(settings, record.soc[0])
    plans = [("nominal", start) for start in (first, *others)]
    plans += [(scenario, first) for scenario in settings.scenarios]
    names = ("nominal", *settings.scenarios)
    plants = {noise: _plants(names, record, bank, noise, hold) for noise in set(noises.values())}
    # ASSUME: On the scale of a cell's own model the deviation of its capacity is that of the scale,
    # which the counted SoC shares; a capacity from elsewhere errs beside a scale that is right.
    elsewhere = [name for name in names if name.startswith("capacity") or not model.get("left_out")]
    scales = {name: 0.0 if name in elsewhere else unsure for name in names}
    shares = {name: unsure - scales[name] for name in names}

    def runs_of(method):
        known = reference, plants[noises[method]], noises[method], scales, shares
        return _runs(method, plans, record, bank, *known)

    duals = runs_of("dual")
    sizes = {name: plant.capacity_ampere_hour for name, plant in plants[noises["dual"]].items()}
    # Of each scenario the first start.
    read = {row["scenario"]: row for row, _ in reversed(duals)}
    off = {name: _capacity_off(read[name], sizes[name], unsure) for name in names}
    shares = {name: float(np.hypot(shares[name], off[name])) for name in names}
    rows, columns = [], {}
    for method in settings.filters:
        runs = duals if method == "dual" else runs_of(method)
        rows += [row | {"capacity_off": off[row["scenario"]]} for row, _ in runs]
        columns |= _series_of(method, with_doubt_of_capacity(runs[0][1], scales["nominal"]))
    misfit = _capacity_in_words(read["nominal"], size) if off["nominal"] else ""
    words = [sentence for sentence in (reference.words, misfit) if sentence]
    notes += words
    known = {"model": model["chosen"], "reference_off_soc": reference.off_soc}
    rows = [row | known | {"doubt": "; ".join(words)} for row in rows]
    series = {"test_time_second": record.test_time_second, "soc": record.soc}
    series |= {"reference_low_soc": reference.low, "reference_high_soc": reference.high}
    series |= {"scored": record.used} | columns
    return Result({"rows": rows, "series": series}, notes=tuple(notes))


def _capacity_off(row, size, unsure):
    """How far the capacity that `dual` reads is off that of a model [1]; 0 where that may be."""
    off, std = row["capacity_ampere_hour"] / size - 1.0, row["capacity_std_ampere_hour"] / size
    return float(off) if abs(off) > NORMAL_95 * np.hypot(std, unsure) else 0.0


def _capacity_in_words(row, size):
    told = f"{row['capacity_ampere_hour']:.3g} ± {row['capacity_std_ampere_hour']:.2g} Ah"
    return f"the capacity of {size:.4g} Ah does not fit: the voltage of the drive tells {told}"


def noise_of(settings, test_time_second):
    """Noise of the filters from the settings of sensors and model.

    A current error of `c` (a rate) that keeps its value is taken as a walk that has gone as far
    after an hour: variance c²/3600 per second.

    Parameters
    ----------
    settings : `settings.Soc`; of the model the filters' own defaults.
    test_time_second : (n,) [s], for the length of the window in samples.
    """
    # ASSUME: An offset of the current sensor acts like a random walk of the SoC that is as large
    # after one hour.
    walk = settings.current_error_c_rate**2 / 3600.0
    step = np.median(np.diff(test_time_second)) if len(test_time_second) > 1 else 1.0
    samples = WINDOW_SECOND / max(step, 1e-3)
    return Noise(
        soc_walk=(walk, WALK_RATIO * walk),
        window=int(np.clip(samples, FEWEST, MOST)),
    )


def _noise_in_words(noise, usual):
    """Note on the noise that the records fitted have told; none where they did not."""
    if noise == usual:
        return []
    return [
        f"noise of the filters, from the records fitted: {1e3 * noise.sensor_volt:.2g} mV in each "
        f"reading; the voltage that answers at once is {100 * noise.resistance_error:.2g} % wrong "
        f"for {noise.fast_second:.2g} s, and up to {1e3 * noise.skew_second:.2g} ms late"
    ]


def _starts(settings, soc):
    """Starts with the stated errors of the SoC, clipped to 0…1."""
    stated = [soc + START_ERROR, *settings.initial_soc]
    clipped = [float(np.clip(value, 0.0, 1.0)) for value in stated]
    return [Start(value, soc_std=START_STD) for value in dict.fromkeys(clipped)]


def _disturbed(scenario, record, bank, start):
    """Record, bank and start of a scenario."""
    if scenario == "current_offset":
        offset = OFFSET_C_RATE * bank.capacity_ampere_hour
        return record._replace(current_ampere=record.current_ampere + offset), bank, start
    if scenario == "voltage_bias":
        biased = record.voltage_volt + BIAS_VOLT
        return record._replace(voltage_volt=biased), bank, start
    if scenario in ("capacity_high", "capacity_low"):
        sign = 1.0 if scenario == "capacity_high" else -1.0
        size = bank.capacity_ampere_hour * (1.0 + sign * CAPACITY_ERROR)
        return record, bank._replace(capacity_ampere_hour=size), start
    if scenario == "mid_drive":
        later = rows_of(record, slice(len(record.used) // 3, None))
        start_soc = later.soc[0] + start.soc - record.soc[0]
        return later, bank, start._replace(soc=float(np.clip(start_soc, 0.0, 1.0)), c_rate=1.0)
    return record, bank, start


def _plants(scenarios, record, bank, noise, hold):
    """Plant of each scenario, without the capacity among its states: every filter starts on one."""

    def laid(disturbed, size):
        columns = (disturbed.test_time_second, disturbed.current_ampere, disturbed.voltage_volt)
        options = {"hold": hold, "resistance_factor": disturbed.resistance_factor}
        return plant_of(size, *columns, noise, **options, track_ohmic=True)

    nominal, plants = laid(record, bank), {}
    for scenario in scenarios:
        disturbed, size, _ = _disturbed(scenario, record, bank, Start(0.0))
        # Of another voltage or capacity nothing else of a plant comes.
        same_current = disturbed.current_ampere is record.current_ampere
        plants[scenario] = (
            nominal._replace(
                voltage_volt=disturbed.voltage_volt, capacity_ampere_hour=size.capacity_ampere_hour
            )
            if same_current
            else laid(disturbed, size)
        )
    return plants


def _runs(method, plans, record, bank, reference, plants, noise, scales, shares):
    """Row and estimate of one filter for each scenario and start.

    scales, shares : by scenario, deviation of the scale of the SoC, and of the capacity that a
    filter counts with [1]; one that estimates it starts from its own, or from that if larger.
    """
    runs, scored = [], {}
    for scenario, first in plans:
        disturbed, size, start = _disturbed(scenario, record, bank, first)
        # A look-up has no start: what it finds in a scenario is the same from all.
        key = (scenario, None if method == "ocv" else first)
        if key not in scored:
            share, dual = shares[scenario], method == "dual"
            start = start._replace(capacity_error=max(share, dual * start.capacity_error))
            tracked = {"track_capacity": dual or share > 0.0, "track_ohmic": True}
            plant = with_tracked(plants[scenario], bank, noise, **tracked)
            estimated = _through_gaps(plant, disturbed, start, method, noise)
            rows = slice(len(record.soc) - len(disturbed.soc), None)
            about = estimated, reference.of_rows(rows), disturbed.used
            score = scores(disturbed.test_time_second, *about, scale_share=scales[scenario])
            scored[key] = estimated, score
        estimated, score = scored[key]
        error = float(start.soc - disturbed.soc[0])
        row = {"filter": method, "scenario": scenario, "initial_soc_error": error} | score
        reason = _reason(row, size, disturbed, plants[scenario])
        runs.append((row | {"reason": reason}, estimated))
    return runs


def _through_gaps(plant, record, start, method, noise):
    """Estimate over a record; after each gap under load a filter starts anew, less sure."""
    first, found = 0, []
    silent = silent_loads(record, capacity_ampere_hour=plant.capacity_ampere_hour)
    for row, counted, std in [*silent, (len(record.soc), 0.0, 0.0)]:
        piece = piece_of(plant, slice(first, row)) if silent else plant
        found.append(estimate_on(piece, start, method=method, noise=noise))
        first, soc = row, float(np.clip(found[-1].soc[-1] + counted, 0.0, 1.0))
        soc_std = float(np.hypot(found[-1].std[-1], std))
        start = start._replace(soc=soc, soc_std=soc_std, c_rate=1.0)
    return Estimate(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def _reason(row, bank, record, plant):
    """Why a filter did not converge, with numbers; empty where it did."""
    if not np.isnan(row["convergence_second"]):
        return ""
    if row["filter"] == "coulomb":
        return "counting keeps the error of its start"
    band, hold = CONVERGED_SOC, HELD_SECOND
    visited = np.clip(record.soc, 0.0, 1.0)
    total = bank.ocv_volt + bank.shift_volt
    ends = [np.interp(np.clip(visited + side, 0, 1), bank.soc, total) for side in (-0.05, 0.05)]
    slope = float(np.median(ends[1] - ends[0]))
    stated = look_at(plant, visited, ERROR)
    error = float(np.hypot(np.median(stated), np.sqrt(plant.slow_variance)))
    if error * 0.1 > band * slope:
        sentence = f"the OCV slope of {1e3 * slope:.1f} mV per 10 % is below what a model error of"
        return f"{sentence} {1e3 * error:.1f} mV allows for {100 * band:g} %"
    return f"never within {100 * band:g} % for {hold:g} s"


def _series_of(method, estimated):
    columns = {f"estimated_{method}_soc": estimated.soc, f"std_{method}_soc": estimated.std}
    if np.isfinite(estimated.innovation_volt).any():
        columns[f"innovation_{method}_volt"] = estimated.innovation_volt
    return columns
