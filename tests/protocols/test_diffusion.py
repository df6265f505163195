"""R²/D from the rest after a long current: the truth within its interval, and each reason."""

import numpy as np
import pytest

import cellwright as cw
from cellwright.protocols.diffusion import diffusion_of_rest, surface_excess
from cellwright.protocols.relaxation import fit_relaxation

LOAD = 900.0
CELL = {"cell": "A", "rated_capacity_ampere_hour": 5.0, "lower_cutoff_volt": 3.0}
CELL |= {"upper_cutoff_volt": 4.2}


def shells(diffusion_second, *, count=200):
    """Lead of the surface in a rest after LOAD by finite volumes of a sphere: (time, lead)."""
    edges = np.linspace(0, 1, count + 1)
    middle, volume = (edges[1:] + edges[:-1]) / 2, np.diff(edges**3) / 3
    flow = edges[1:-1] ** 2 / np.diff(middle) / diffusion_second
    matrix = np.zeros((count, count))
    for k, g in enumerate(flow):
        matrix[[k, k + 1], [k, k + 1]] -= g
        matrix[[k, k + 1], [k + 1, k]] += g
    rates, modes = np.linalg.eigh(matrix / np.sqrt(np.outer(volume, volume)))
    source = np.zeros(count)
    source[-1] = 1.0 / 3.0 / np.sqrt(volume[-1])  # one unit of the mean a second
    share = modes.T @ source
    still = np.abs(rates) < 1e-12
    grown = np.where(still, LOAD, np.expm1(rates * LOAD) / np.where(still, 1.0, rates)) * share
    time = np.concatenate([np.arange(1.0, 30), np.arange(30.0, 3600, 10)])
    decay = np.exp(np.outer(time, np.where(still, 0.0, rates)))
    surface = (decay * grown) @ (modes[-1] / np.sqrt(volume[-1]))
    return time, surface - LOAD  # the mean moved by LOAD


def rest(diffusion_second, seed, *, slope=0.8, noise=2e-4, fast=0.0):
    """Rest after 1 A for LOAD out of 5 Ah at 3.7 V: (time, voltage, voltage before)."""
    time, lead = shells(diffusion_second)
    per_second = -1.0 / 3600 / 5.0
    volt = 3.7 + slope * per_second * lead + fast * np.exp(-time / 8.0)
    volt = volt + noise * np.random.default_rng(seed).standard_normal(len(time))
    return time, volt, 3.7 - slope * per_second * LOAD


def found(time, volt, before, **load):
    about = {"load_second": LOAD, "current_ampere": -1.0, "before_volt": before} | load
    return diffusion_of_rest(time, volt, fit_relaxation(time, volt), **about)


def test_the_series_is_that_of_finite_volumes():
    time, lead = shells(2500.0)
    late = time > 20  # at first the outermost shell, 1/200 of the radius, is none of the surface
    excess, slope = surface_excess(time, LOAD, 2500.0)
    assert lead[late] == pytest.approx((excess * 2500.0 / 3.0)[late], rel=0.01, abs=0.01)
    step = [surface_excess(time, LOAD, 2500.0 * np.exp(sign * 1e-4))[0] for sign in (-1, 1)]
    assert slope == pytest.approx((step[1] - step[0]) / 2e-4, abs=1e-6)


@pytest.mark.parametrize("truth", [800.0, 2500.0, 9000.0])
def test_nine_of_ten_intervals_hold_the_diffusion_time(truth):
    results = [found(*rest(truth, seed, noise=1e-4)) for seed in range(12)]
    off = [(one.second - truth) / one.std_second for one in results]
    assert np.mean(np.abs(off) < 1.96) >= 0.9
    assert all(one.std_second < 0.3 * truth for one in results)
    assert np.median([one.by_size_second for one in results]) == pytest.approx(truth, rel=0.05)


def test_what_relaxes_fast_beside_it_is_fitted_apart():
    one = found(*rest(2500.0, 1, noise=5e-5, fast=-0.004))
    assert one.fast_second == pytest.approx(8.0, rel=0.3)
    assert abs(one.second - 2500.0) < 2 * one.std_second


def test_a_size_that_contradicts_the_shape_widens_the_interval_or_refuses():
    time, volt, before = rest(2500.0, 1)
    alone, apart = found(time, volt, before), found(time, volt, 3.7 + (before - 3.7) / 1.5)
    assert apart.std_second > 2 * alone.std_second
    with pytest.raises(cw.Refusal, match=r"its shape says R²/D = .* its size .* no diffusion"):
        found(time, volt, 3.7 + (before - 3.7) / 4)


def test_exponentials_a_wrong_sign_and_a_rest_too_short_are_refused():
    time, volt, before = rest(2500.0, 1)
    with pytest.raises(cw.Refusal, match="relaxes away from the open-circuit voltage"):
        found(time, volt, before, current_ampere=1.0)
    noise = 2e-5 * np.random.default_rng(2).standard_normal(len(time))
    pairs = 3.7 - 0.02 * np.exp(-time / 20) - 0.01 * np.exp(-time / 900) + noise
    with pytest.raises(cw.Refusal, match="exponentials fit it better"):
        found(time, pairs, before)
    with pytest.raises(cw.Refusal, match=r"beyond what the rest tells|no surer than by half"):
        found(*(column[:45] for column in rest(2e5, 1)[:2]), np.nan)


def test_a_titration_tells_it_at_each_state_of_charge_and_together():
    parts, soc, now = [], 0.9, 0.0
    for _ in range(3):
        at_rest, lead = shells(2500.0)
        excess = (1 - np.exp(-np.arange(10.0, LOAD, 10) / 130.0)) * 2500.0 / 15
        drop = -1.0 / 3600 / 5.0
        load = np.arange(10.0, LOAD, 10)
        volts = 3.0 + 0.8 * (soc + drop * (load + excess)) - 0.02
        soc += drop * LOAD
        relaxed = 3.0 + 0.8 * (soc + drop * lead)
        parts += [
            (now + load, -1.0, volts),
            (now + LOAD, -1.0, volts[-1:]),
            (now + LOAD + at_rest, 0.0, relaxed),
        ]
        now += LOAD + 3600
    time, current, volt = (
        np.concatenate([np.broadcast_to(part[k], np.shape(part[0]) or (1,)) for part in parts])
        for k in range(3)
    )
    first = np.arange(0.0, 700, 10)
    time = np.concatenate([first, 700 + time])
    current = np.concatenate([0 * first, current])
    volt = np.concatenate([0 * first + 3.0 + 0.8 * 0.9, volt])
    volt = volt + 1e-4 * np.random.default_rng(4).standard_normal(len(volt))
    charge = np.concatenate([[0], np.cumsum(current[1:] * np.diff(time))]) / 3600
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    series |= {"charge_ampere_hour": charge}
    test = {"test": "gitt", "kind": "hppc", "soc": 0.9}
    basis = {"capacity_ampere_hour": 5.0, "ocv": []}
    result = cw.relaxation(series, cw.segment(series, CELL), basis, test, CELL)
    rows = result.rows
    told = np.isfinite(rows["diffusion_second"]) & rows["chosen"]
    assert told.sum() == 3
    assert np.all(
        np.abs(rows["diffusion_second"] - 2500)[told] < 3 * rows["diffusion_std_second"][told]
    )
    (words,) = [note for note in result.notes if "diffusion time" in note]
    assert "over 3 rests" in words
