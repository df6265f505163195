"""Degradation modes: known losses found, intervals that hold, and what is not knowable."""

import numpy as np
import pytest
from half_cell_lives import LOSSES, curve_of, life, nmc

from cellwright.health.electrodes import alignment
from cellwright.health.electrodes.alignment import Pair, align, chosen_pair
from cellwright.health.electrodes.half_cells import half_cell
from cellwright.health.electrodes.mode_rows import mode_rows
from cellwright.health.electrodes.modes import degradation_modes
from cellwright.refusal import Refusal


@pytest.fixture(scope="module")
def lives():
    """Estimates of five lives whose half cells err by 2 mV, and by 1 mV one by one."""
    pair, _ = nmc()
    return [degradation_modes(life(seed), pair) for seed in range(5)]


def test_losses_are_within_one_and_a_half_percent(lives):
    errors = np.array([found.joint - LOSSES for found in lives])[:, 1:]
    assert np.sqrt(np.mean(errors**2, axis=(0, 1))).max() < 0.012
    assert abs(errors.mean()) < 0.004


@pytest.mark.parametrize("way", ["joint", "single"])
def test_intervals_hold(lives, way):
    """45 values; those of one life hang together, so that the share scatters by several percent."""
    errors = np.array([getattr(found, way) - LOSSES for found in lives])[:, 1:]
    stds = np.array([getattr(found, f"{way}_std") for found in lives])[:, 1:]
    inside = np.abs(errors) < 1.96 * stds
    assert 0.86 <= inside.mean() <= 1.0
    assert stds.mean() < 0.02, "intervals that hold all are of no use"


def test_active_material_does_not_come_back(lives):
    for found in lives:
        assert np.all(np.diff(found.joint[:, 1:], axis=0) >= -1e-9)


def test_two_curves_of_one_fresh_cell_lose_nothing():
    pair, _ = nmc()
    found = degradation_modes(life(3, losses=np.zeros((2, 3))), pair)
    assert np.all(np.abs(found.single[1]) < 1.96 * found.single_std[1])
    assert np.abs(found.single[1]).max() < 0.01


def test_lithium_that_comes_back_is_seen():
    """From the overhang of the negative electrode: a loss below zero is no fault."""
    pair, _ = nmc()
    losses = np.array([[0.0, 0.0, 0.0], [-0.01, 0.0, 0.0]])
    found = degradation_modes(life(5, losses=losses, own_volt=0.0003), pair)
    assert found.joint[1, 0] == pytest.approx(-0.01, abs=0.004)


@pytest.mark.parametrize("branches", ["both", "charge", "rests"])
def test_derivatives_are_those_of_differences(branches):
    pair, _ = nmc()
    curve = life(1)[0]._replace(branches=branches)
    errors = np.linspace(0.001, 0.004, len(curve.soc))
    limits = np.array([0.031, 0.83, 0.92, 0.28, 0.004, -0.002])
    before = alignment._whitened(limits, curve, pair, errors)
    slopes = alignment._derivatives(limits, curve, pair, errors)
    for k, column in enumerate(slopes.T):
        step = np.where(np.arange(6) == k, 1e-9, 0.0)
        moved = (alignment._whitened(limits + step, curve, pair, errors) - before) / 1e-9
        # A sample whose lithiation crosses a point of the table within the step has two slopes.
        assert np.mean(np.isclose(column, moved, rtol=1e-3, atol=1e-2)) > 0.99


def test_limits_and_shift_of_one_curve_are_found():
    pair, _ = nmc()
    curve = life(1, common_volt=0.0, own_volt=0.0, shift_volt=0.012)[2]
    found = align(curve, pair)
    assert found.limits[4] == pytest.approx(0.012, abs=0.001)
    assert found.rmse_volt < 2e-4


def test_a_window_without_features_tells_nothing():
    """A charge between 30 and 55 % of the positive's slope: its capacity could be anything."""
    pair, _ = nmc()
    curves = []
    for whole in life(2)[:2]:
        part = (whole.soc > 0.45) & (whole.soc < 0.6)
        soc = (whole.soc[part] - whole.soc[part][0]) / np.ptp(whole.soc[part])
        charge = whole.capacity_ampere_hour * np.ptp(whole.soc[part])
        curves.append(curve_of(soc, whole.voltage_volt[part], charge, cycle=whole.cycle))
    found = degradation_modes(curves, pair)
    rows = mode_rows(found, pair, curves)
    assert not rows[1]["identifiable"]
    assert "not identifiable from this window" in rows[1]["reason"]
    unknown = [
        mode for mode in ("lli", "lam_negative", "lam_positive") if mode in rows[1]["reason"]
    ]
    assert all(np.isnan(rows[1][mode]) and np.isnan(rows[1][f"{mode}_std"]) for mode in unknown)


def test_half_cells_of_another_chemistry_are_refused():
    negative = half_cell("graphite_siox_chen")
    others = [Pair(negative, half_cell(name)) for name in ("lfp_afshar", "lmo_doyle")]
    with pytest.raises(Refusal, match=r"do not fit: best are .* is the chemistry right\?"):
        chosen_pair(life(0)[:2], others, misfit_volt=0.01)


@pytest.mark.slow
def test_right_half_cells_are_chosen_among_others():
    negatives = ("graphite_siox_chen", "graphite_mohtat", "graphite_ecker")
    positives = ("nmc811_chen", "nmc532_mohtat")
    pairs = [Pair(half_cell(n), half_cell(p)) for n in negatives for p in positives]
    (best, misfit), *_ = chosen_pair(life(0)[:2], pairs, misfit_volt=0.01)
    assert (best.negative.name, best.positive.name) == ("graphite_siox_chen", "nmc811_chen")
    assert misfit < 0.004


@pytest.mark.slow
def test_half_cells_that_fit_as_well_widen_the_interval():
    pair, _ = nmc()
    curves = life(4)[:2]
    other = Pair(half_cell("graphite_safari"), pair.positive)
    alone = degradation_modes(curves, pair)
    both = degradation_modes(curves, pair, others=[other])
    assert np.all(both.single_std[1] >= alone.single_std[1])
    assert both.single_std[1].sum() > 1.2 * alone.single_std[1].sum()
