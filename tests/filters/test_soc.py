"""SoC filters on cells whose truth is known: starts, coverage, capacity, innovations."""

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test
from truth import stated

from cellwright.filters import evaluate
from cellwright.filters.bank import bank_of
from cellwright.filters.estimate import METHODS, Start, estimate, estimate_on
from cellwright.filters.evaluate import (
    chi_square,
    convergence_second,
    estimate_soc,
    innovation_tests,
)
from cellwright.filters.plant import Noise, plant_of
from cellwright.numerics.lags import lag
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal
from cellwright.settings import Soc

ERROR, SECOND, SPAN = 0.01, 300.0, 0.3
BANK = bank_of(stated(), None, 25.0)
BANK = BANK._replace(error_volt=np.full(len(BANK.soc), ERROR), load_error_volt=0.0)
# What the truth below is made with, stated to the filter.
MATCHED = Noise(
    resistance_error=0.0,
    error_second=SECOND,
    error_soc=0.0,
    fast_second=0.0,
    skew_second=0.0,
    least_error_volt=0.0,
    least_rest_volt=0.0,
    soc_walk=(1e-12, 1e-11),
)


def world(seed, seconds=5000, *, r0_scale=1.0):
    """A drive of the true cell whose model is off by a slow error of 10 mV; 2 mV of noise."""
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng, seconds)
    soc = truth.soc_of(time, current, 0.95)
    keep = np.exp(-1.0 / SECOND)
    kicks = rng.normal(size=seconds) * ERROR * np.sqrt(1 - keep**2) / (1 - keep)
    slow = lag(np.ones(seconds - 1), SECOND, kicks, hold="zero_order", initial=rng.normal() * ERROR)
    more = (r0_scale - 1.0) * np.interp(soc, truth.KNOTS, truth.R0) * current
    voltage = truth.voltage(time, current, soc) + slow + more
    return time, current, voltage + 0.002 * rng.normal(size=seconds), soc


def run(data, method, start, noise=MATCHED, bank=BANK, **settings):
    return estimate(bank, *data[:3], start, method=method, noise=noise, **settings)


@pytest.mark.parametrize("method", ["ekf", "aekf", "dual"])
def test_intervals_cover_where_the_model_errs_slowly(method):
    """95 % of 40 records' samples; taken for white noise, the same error leaves under a half."""
    worlds = [world(seed) for seed in range(40)]
    starts = np.random.default_rng(0).uniform(0, 1, 40)

    def share(noise):
        values = [run(d, method, Start(s), noise) for d, s in zip(worlds, starts, strict=True)]
        inside = [np.abs(f.soc - d[3]) < 1.96 * f.std for f, d in zip(values, worlds, strict=True)]
        return np.mean(inside)

    assert 0.92 < share(MATCHED) < 0.985
    assert share(MATCHED._replace(error_second=0.0)) < 0.5


@pytest.mark.parametrize("method", ["ekf", "aekf", "dual"])
@pytest.mark.parametrize("soc", [*np.linspace(0, 1, 11), 0.98, 0.6])
def test_any_start_ends_at_the_same_soc(method, soc):
    data = world(1)
    estimated = run(data, method, Start(soc), Noise())
    error = estimated.soc - data[3]
    assert convergence_second(data[0], error, band=0.03, hold_second=600) < 300
    assert np.sqrt(np.mean(error[300:] ** 2)) < 0.015


def test_a_start_away_from_rest_is_covered_too():
    data = [column[700:] for column in world(2)]
    estimated = run(data, "aekf", Start(0.3, c_rate=1.0), Noise())
    assert np.abs(estimated.soc - data[3])[600:].max() < 0.03
    assert np.mean(np.abs(estimated.soc - data[3]) < 1.96 * estimated.std) > 0.9


def test_capacity_is_found_and_its_error_is_honest():
    rng = np.random.default_rng(3)
    off = []
    for seed in range(24):
        wrong = BANK._replace(capacity_ampere_hour=2.0 * (1 + 0.1 * rng.normal()))
        estimated = run(world(seed, 8000), "dual", Start(0.65), bank=wrong)
        std = estimated.capacity_std_ampere_hour[-1]
        off.append(((estimated.capacity_ampere_hour[-1] - 2.0) / std, std))
    ratio, std = np.array(off).T
    assert 0.6 < np.sqrt(np.mean(ratio**2)) < 1.5
    assert std.mean() < 0.05


def standing(seed):
    """As `world`, with a further error that stands over SoC: as far as it is right, as wide."""
    time, current, voltage, soc = world(seed, 8000)
    rng = np.random.default_rng(1000 + seed)
    grid = np.linspace(-0.1, 1.1, 601)
    keep = np.exp(-np.diff(grid)[0] / SPAN)
    kicks = rng.normal(size=len(grid)) * np.sqrt(1 - keep**2)
    kicks[0] = rng.normal()
    course = [kicks[0]]
    for kick in kicks[1:]:
        course.append(keep * course[-1] + kick)
    return time, current, voltage + ERROR * np.interp(soc, grid, course), soc


@pytest.mark.parametrize("method", ["aekf", "dual"])
def test_an_error_that_stands_over_soc_is_covered_if_it_is_stated(method):
    """Also that of the capacity; left out, 95 % intervals of the SoC cover under two thirds."""
    starts = np.random.default_rng(5).uniform(0, 1, 30)

    def judged(noise, load_error_volt):
        bank = BANK._replace(load_error_volt=load_error_volt)
        inside, ratio = [], []
        for seed, start in enumerate(starts):
            data = standing(seed)
            estimated = run(data, method, Start(start, capacity_error=0.05), noise, bank)
            inside.append(np.mean(np.abs(estimated.soc - data[3]) < 1.96 * estimated.std))
            off = estimated.capacity_ampere_hour[-1] - 2.0
            ratio.append(off / estimated.capacity_std_ampere_hour[-1])
        return np.mean(inside), np.sqrt(np.mean(np.square(ratio)))

    inside, ratio = judged(MATCHED._replace(error_soc=SPAN), ERROR)
    without, more = judged(MATCHED, 0.0)
    assert 0.9 < inside < 0.99
    assert without < 0.85
    print(inside, without, ratio, more)
    if method == "dual":
        assert 0.6 < ratio < 1.4
        assert more > 1.5


@pytest.mark.parametrize("method", ["ekf", "aekf"])
def test_a_resistance_that_grew_is_found_instead_of_a_wrong_soc(method):
    data = world(4, r0_scale=1.4)
    estimated = run(data, method, Start(0.65), Noise())
    assert estimated.ohmic_scale[-1] == pytest.approx(
        1.4, abs=3 * estimated.ohmic_scale_std[-1] + 0.03
    )
    assert np.sqrt(np.mean((estimated.soc - data[3])[300:] ** 2)) < 0.02


def test_a_voltage_that_is_read_late_does_not_kick_the_soc():
    """Sampled at 10 Hz, the voltage one sample behind the current."""
    time, current = world(11, 20000)[:2]
    time = time / 10
    soc = truth.soc_of(time, current, 0.95)
    voltage = truth.voltage(time, current, soc)
    late = np.append(voltage[:1], voltage[:-1])
    late += 0.002 * np.random.default_rng(1).normal(size=len(late))
    data = time, current, late
    error = [
        np.sqrt(np.mean((run(data, "aekf", Start(0.65), noise).soc - soc)[100:] ** 2))
        for noise in (Noise(), Noise(skew_second=0.0))
    ]
    assert error[0] < 0.002
    assert error[1] > 5 * error[0]


def test_resistances_follow_the_temperature_along_a_record():
    time, current, voltage, soc = world(11)
    resistance_factor = np.linspace(1.6, 0.8, len(time))
    more = (resistance_factor - 1.0) * (
        truth.voltage(time, current, soc) - np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT)
    )
    data = time, current, voltage + more, soc
    off = [
        run(data, "aekf", Start(0.65), Noise(), **given).soc - soc
        for given in ({"resistance_factor": resistance_factor}, {})
    ]
    followed, not_followed = (np.sqrt(np.mean(o[300:] ** 2)) for o in off)
    assert followed < 0.02
    assert followed < not_followed


@pytest.mark.parametrize("fault", ["offset", "bias", "capacity"])
def test_sensor_faults_stay_inside_what_is_stated(fault):
    time, current, voltage, soc = world(5)
    given = {
        "offset": (time, current + 0.02, voltage),
        "bias": (time, current, voltage + 0.005),
        "capacity": (time, current, voltage),
    }[fault]
    bank = BANK._replace(capacity_ampere_hour=2.2) if fault == "capacity" else BANK
    method = "dual" if fault == "capacity" else "aekf"
    estimated = estimate(bank, *given, Start(0.65), method=method)
    assert np.sqrt(np.mean((estimated.soc - soc)[300:] ** 2)) < 0.025
    assert np.mean(np.abs(estimated.soc - soc) < 1.96 * estimated.std) > 0.85


def test_innovations_of_a_matched_filter_pass_their_tests():
    results = [run(world(s), "ekf", Start(0.5)) for s in range(6)]
    tests = [innovation_tests(f.innovation_volt[1:], f.innovation_std_volt[1:]) for f in results]
    assert np.mean([t["nis_low"] < t["nis_mean"] < t["nis_high"] for t in tests]) > 0.6
    assert np.mean([t["white"] for t in tests]) > 0.6
    half = MATCHED._replace(sensor_volt=0.001)
    estimated = run(world(1), "ekf", Start(0.5), half)
    test = innovation_tests(estimated.innovation_volt[1:], estimated.innovation_std_volt[1:])
    assert test["nis_mean"] > test["nis_high"]


def test_the_adaptive_filter_finds_the_noise_that_was_understated():
    quiet = MATCHED._replace(sensor_volt=0.0005)
    estimated = run(world(6), "aekf", Start(0.5), quiet)
    assert np.mean((estimated.innovation_volt / estimated.innovation_std_volt)[1000:] ** 2) < 1.2
    fixed = run(world(6), "ekf", Start(0.5), quiet)
    assert np.mean((fixed.innovation_volt / fixed.innovation_std_volt)[1000:] ** 2) > 3


def test_counting_keeps_the_error_of_its_start_and_the_look_up_needs_none():
    data = world(7)
    counted = run(data, "coulomb", Start(0.65, soc_std=0.3))
    np.testing.assert_allclose(counted.soc - data[3], -0.3, atol=1e-9)
    looked = [run(data, "ocv", Start(s)).soc for s in (0.1, 0.9)]
    np.testing.assert_array_equal(*looked)
    assert np.sqrt(np.mean((looked[0] - data[3]) ** 2)) < 0.05
    assert np.isnan(counted.innovation_volt).all()


def test_a_flat_ocv_teaches_nothing_and_the_filter_says_so():
    model = stated()
    model["ocv"][0]["ocv_volt"] = (3.3 + 1e-3 * np.array(model["ocv"][0]["soc"])).tolist()
    time, current = truth.drive(np.random.default_rng(8), 3000)
    voltage = np.full(len(time), 3.3) + 0.03 * current
    estimated = estimate(
        bank_of(model, None, 25.0), time, current, voltage, Start(0.5), method="ekf"
    )
    assert estimated.std[-1] > 0.2


def test_convergence_needs_to_stay():
    time = np.arange(10.0)
    error = np.array([0.3, 0.01, 0.3, 0.02, 0.01, 0.01, 0.01, 0.2, 0.01, 0.01])
    assert convergence_second(time, error, band=0.03, hold_second=3) == 3
    assert convergence_second(time, error, band=0.03, hold_second=0) == 1
    assert np.isnan(convergence_second(time, error, band=0.03, hold_second=4))


@pytest.mark.parametrize("degrees", [20, 1000])
def test_chi_square_quantiles(degrees):
    from scipy.stats import chi2, norm

    for p in (0.025, 0.5, 0.95, 0.975):
        assert chi_square(norm.ppf(p), degrees) == pytest.approx(chi2.ppf(p, degrees), rel=0.006)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"method": "ukf"}, "'ukf' is unknown; known are coulomb, ocv"),
        ({"start": Start(1.2)}, "wanted 0 to 1"),
        ({"start": Start(0.5, soc_std=0.0)}, "with some doubt"),
    ],
)
def test_refusals(change, reason):
    given = {"method": "ekf", "start": Start(0.5)} | change
    with pytest.raises(Refusal, match=reason):
        run(world(1, 100), given["method"], given["start"])


SETTINGS = {
    "filters": tuple(METHODS),
    "initial_soc": [0.0],
    "scenarios": ["current_offset", "voltage_bias", "capacity_high", "capacity_low", "mid_drive"],
    "current_error_c_rate": 0.005,
}


def measured(seed):
    time, current, voltage, soc = world(seed)
    charge = (soc - soc[0]) * truth.CAPACITY_AMPERE_HOUR
    names = ["test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour"]
    series = dict(zip(names, (time, current, voltage, charge), strict=True))
    return measured_test(series, soc=0.95, role="validation")


@pytest.mark.parametrize("scenario", SETTINGS["scenarios"])
def test_a_scenario_is_laid_out_as_its_own_record_and_bank_would_be(scenario):
    facts = cell_facts(3.0, 4.2)
    record = laid_out(measured(9), stated(), facts, split_rest_second=120.0, proof=True)
    factor = np.linspace(1.0, 1.2, len(record.soc))
    given = (record._replace(resistance_factor=factor), BANK, MATCHED, "first_order")
    plant = evaluate._plants(("nominal", scenario), *given)[scenario]
    own, bank, _ = evaluate._disturbed(scenario, given[0], BANK, Start(0.5))
    columns = own.test_time_second, own.current_ampere, own.voltage_volt
    options = {"hold": "first_order", "resistance_factor": own.resistance_factor}
    expected = plant_of(bank, *columns, MATCHED, **options, track_ohmic=True)
    for name, one, other in zip(plant._fields, plant, expected, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


@pytest.mark.parametrize("method", METHODS)
def test_no_filter_knows_the_soc_better_than_the_capacity_that_it_refers_to(method):
    """On the scale of its own model what it errs by grows from full on; no voltage tells it.

    The counted SoC shares that scale: the interval that is scored is without it.
    """
    about = measured(9), stated(), cell_facts(3.0, 4.2)
    record = laid_out(*about, split_rest_second=120.0, proof=True)
    settings = Soc(**SETTINGS)._replace(filters=(method,), scenarios=())
    size = stated()["capacity_ampere_hour"]
    own = stated() | {"left_out": [{}]}
    models = own, own | {"capacity_std_ampere_hour": 0.02 * size}
    runs = [estimate_soc(model, record, settings) for model in models]
    sure, unsure = (run.series for run in runs)
    assert runs[1].rows[0]["coverage_95"] == runs[0].rows[0]["coverage_95"]
    assert runs[1].rows[0]["soc_std"] > runs[0].rows[0]["soc_std"]
    more = np.sqrt(unsure[f"std_{method}_soc"] ** 2 - sure[f"std_{method}_soc"] ** 2)
    soc = sure[f"estimated_{method}_soc"]
    np.testing.assert_array_equal(unsure[f"estimated_{method}_soc"], soc)
    np.testing.assert_allclose(more, 0.02 * np.abs(1 - soc), atol=1e-6)


@pytest.mark.parametrize("method", ["coulomb", "ekf", "aekf"])
def test_a_capacity_in_doubt_acts_as_counted_charge(method):
    """It is 10 % too large, and stated to be so sure: without its doubt few samples are held.

    Counting from the right start nothing else is in doubt; a filter corrects most of it.
    """
    wrong = BANK._replace(capacity_ampere_hour=1.1 * truth.CAPACITY_AMPERE_HOUR)

    def share(doubt, seed):
        time, current, voltage, soc = world(seed)
        tracked = {"track_capacity": doubt > 0.0}
        plant = plant_of(wrong, time, current, voltage, MATCHED, hold="first_order", **tracked)
        start = Start(soc[0], soc_std=1e-3, capacity_error=doubt)
        found = estimate_on(plant, start, method=method, noise=MATCHED)
        assert np.isnan(found.capacity_ampere_hour).all()
        return np.mean(np.abs(found.soc - soc) < 1.96 * found.std)

    held, without = (np.mean([share(doubt, s) for s in range(8)]) for doubt in (0.1, 0.0))
    assert held > 0.9
    assert without < 0.7


@pytest.mark.parametrize("method", ["ekf", "aekf", "dual"])
def test_a_filter_knows_that_it_does_not_know_what_flowed_in_a_gap(method):
    """Ten minutes of a drive are lost between two unlike loads; the count leaves them out."""
    time, current, voltage, soc = world(9)
    lost = slice(2000, 2600)
    rows = np.delete(np.arange(len(time)), lost)
    current[[1999, 2600]] = -1.0, -3.0
    missed = (soc[2600] - soc[1999]) * (np.arange(len(time)) >= 2600)
    charge = (soc - soc[0] - missed) * truth.CAPACITY_AMPERE_HOUR
    names = ["test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour"]
    columns = (column[rows] for column in (time, current, voltage, charge))
    test = measured_test(dict(zip(names, columns, strict=True)), soc=0.95, role="validation")
    facts = cell_facts(3.0, 4.2)
    record = laid_out(test, stated(), facts, split_rest_second=120.0, proof=True)
    settings = Soc(**SETTINGS)._replace(filters=(method,), scenarios=())
    series = estimate_soc(stated(), record, settings).series
    error = np.abs(series[f"estimated_{method}_soc"] - soc[rows])
    std = series[f"std_{method}_soc"]
    assert std[2000] > 2 * std[1999]
    assert np.mean(error[2000:] < 1.96 * std[2000:]) > 0.9
    assert error[-1] < 0.02


def test_a_test_is_run_by_every_filter_start_and_scenario():
    about = measured(9), stated(), cell_facts(3.0, 4.2)
    record = laid_out(*about, split_rest_second=120.0, proof=True)
    found = estimate_soc(stated(), record, Soc(**SETTINGS))
    rows, series = found.rows, found.series
    assert len(rows) == len(METHODS) * (2 + 5)
    nominal = {row["filter"]: row for row in rows if row["scenario"] == "nominal"}
    assert nominal["coulomb"]["reason"] == "counting keeps the error of its start"
    assert nominal["aekf"]["convergence_second"] < 300
    assert nominal["aekf"]["rmse_soc"] < 0.015
    looked_up = [row for row in rows if (row["filter"], row["scenario"]) == ("ocv", "nominal")]
    assert [row["initial_soc_error"] for row in looked_up] == pytest.approx([-0.3, -0.95], abs=1e-3)
    assert looked_up[0]["rmse_soc"] == looked_up[1]["rmse_soc"]
    assert "estimated_dual_soc" in series
    assert "innovation_coulomb_volt" not in series
