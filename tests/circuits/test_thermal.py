"""Lumped thermal state: closed forms, the fit's truth."""

import numpy as np
import pytest

from cellwright import formats
from cellwright.circuits.heat import fit_thermal, heat, temperature
from cellwright.refusal import Refusal

BODY = {"heat_capacity_joule_per_kelvin": 45.0, "resistance_kelvin_per_watt": 8.0}


def test_constant_heat_is_the_closed_form_and_an_edge_changes_nothing():
    time = np.array([0.0, 10.0, 10.0, 100.0, 1e5])
    celsius = temperature(time, np.full(5, 0.5), 20.0, initial_celsius=22.0, **BODY)
    np.testing.assert_allclose(celsius, 24.0 - 2.0 * np.exp(-time / 360.0), atol=1e-12)
    np.testing.assert_allclose(temperature(time, np.zeros(5), 20.0, **BODY), 20.0)


def test_the_ambient_is_followed():
    time = np.linspace(0, 3600, 721)
    celsius = temperature(time, 0 * time, time / 100, **BODY)
    np.testing.assert_allclose(celsius, (time - 360 * -np.expm1(-time / 360)) / 100, atol=1e-10)


def test_losses_warm_both_ways_and_reversible_heat_turns_with_the_current():
    current, over = np.array([2.0, -2.0]), np.array([0.1, -0.1])
    np.testing.assert_allclose(heat(current, 3.7 + over, 3.7), 0.2)
    both = heat(current, 3.7 + over, 3.7, temperature_celsius=26.85, entropic_volt_per_kelvin=1e-4)
    np.testing.assert_allclose(both, [0.26, 0.14])


def record(rng, *, entropic=0.0, gap=False, noise_kelvin=0.02):
    """Random loads and rests over 4 h at 1 s, with a thermometer that reads 0.3 K too much."""
    time = np.arange(14_400.0)
    current = np.repeat(rng.uniform(-4, 4, 48) * (rng.random(48) < 0.6), 300)
    over = 0.06 * current + 0.02 * current * (np.sin(time / 700) > 0)
    true = np.full(len(time), 25.0)
    for _ in range(5):  # reversible heat asks for the temperature itself
        watt = heat(
            current,
            3.7 + over,
            3.7,
            temperature_celsius=true,
            entropic_volt_per_kelvin=entropic,
        )
        true = temperature(time, watt, 25.0, initial_celsius=23.0, **BODY)
    measured = true + 0.3 + noise_kelvin * rng.normal(size=len(time))
    kept = (time < 6000) | (time > 8000) if gap else np.ones(len(time), bool)
    return [x[kept] for x in (time, current, 3.7 + over, np.full(len(time), 3.7), measured)]


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("entropic", [0.0, 2e-4])
def test_the_fit_recovers_the_truth(entropic, gap):
    noisy = record(np.random.default_rng(1), entropic=entropic, gap=gap)
    shape = np.ones((len(noisy[0]), 1)) if entropic else None
    fit = fit_thermal(*noisy, 25.0, entropic_shape=shape)
    values = [fit.heat_capacity_joule_per_kelvin, fit.resistance_kelvin_per_watt]
    std = [fit.heat_capacity_std_joule_per_kelvin, fit.resistance_std_kelvin_per_watt]
    np.testing.assert_array_less(np.abs(np.subtract(values, [45.0, 8.0])), 4 * np.array(std))
    np.testing.assert_array_less(std, [0.2, 0.04])
    assert fit.ambient_offset_kelvin == pytest.approx(0.3, abs=0.01)
    np.testing.assert_allclose(fit.entropic_volt_per_kelvin, entropic, atol=1e-6)
    np.testing.assert_array_less(fit.entropic_std_volt_per_kelvin, 1e-6)
    assert fit.rmse_kelvin == pytest.approx(0.02, rel=0.05)


@pytest.mark.slow
def test_its_intervals_cover():
    inside = 0
    for seed in range(30):
        fit = fit_thermal(*record(np.random.default_rng(seed)), 25.0)
        off = fit.heat_capacity_joule_per_kelvin - 45.0
        inside += abs(off) < 1.96 * fit.heat_capacity_std_joule_per_kelvin
    assert inside >= 25


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({1: 0.0}, "holds no heat"),
        ({4: np.nan}, "not finite"),
        ({0: slice(0, 5)}, "5 samples"),
    ],
)
def test_the_fit_refuses(change, reason):
    given = record(np.random.default_rng(2))
    for place, value in change.items():
        if isinstance(value, slice):
            given = [column[value] for column in given]
        else:
            given[place] = np.full(len(given[0]), value)
    with pytest.raises(Refusal, match=reason):
        fit_thermal(*given, 25.0)


def test_a_temperature_that_falls_with_heat_or_never_settles_is_refused():
    time, current, voltage, ocv, measured = record(np.random.default_rng(3))
    with pytest.raises(Refusal, match="falls with heat"):
        fit_thermal(time, current, voltage, ocv, 50.0 - measured, 25.0)
    with pytest.raises(Refusal, match="not within 30–60 s"):
        fit_thermal(time, current, voltage, ocv, measured, 25.0, tau_bounds_second=(30.0, 60.0))


def test_thermal_refusals():
    time = np.arange(3.0)
    with pytest.raises(Refusal, match="both must be above zero"):
        temperature(time, time, 20.0, **(BODY | {"resistance_kelvin_per_watt": 0.0}))
    with pytest.raises(Refusal, match="needs a temperature"):
        heat(time, time, time, entropic_volt_per_kelvin=1e-4)


@pytest.mark.slow
def test_an_18650_weighs_what_it_weighs(shared):
    """Panasonic NCR18650PF, 47 g: about 45 J/K; its surface lags, and its holder takes part."""
    path = shared / "campaigns/panasonic/raw/hppc/hppc_n10C.parquet"
    columns = formats.read(path.read_bytes(), name=path.name).columns
    rest = columns["current_ampere"] == 0
    before = np.maximum.accumulate(np.where(rest, np.arange(len(rest)), 0))
    names = ["test_time_second", "current_ampere", "voltage_volt", "surface_temperature_celsius"]
    time, current, voltage, surface = (columns[name] for name in names)
    fit = fit_thermal(time, current, voltage, voltage[before], surface, -10.0)
    assert 40 < fit.heat_capacity_joule_per_kelvin < 60
    assert 300 < fit.heat_capacity_joule_per_kelvin * fit.resistance_kelvin_per_watt < 600
