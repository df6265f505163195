"""Plateaus of slow curves: their charge and what each has lost, where the truth is known."""

import numpy as np
import pytest
from half_cell_lives import SOC, curve_of

from cellwright.health.electrodes.plateaus import boundaries, plateau_losses
from cellwright.refusal import Refusal

STEPS_VOLT = (3.2, 3.3, 3.4, 3.5)


def curve(*charges, cycle=0.0, seed=None, noise_volt=0.0, volts=STEPS_VOLT):
    """A curve of flat plateaus of these charges [Ah], with a step of 0.1 V between two."""
    edges = np.cumsum(charges)[:-1]
    charge = SOC * sum(charges)
    volt = volts[0] + 0.02 * SOC
    for edge, low, high in zip(edges, volts, volts[1:], strict=False):
        volt = volt + (high - low) / 2 * (1 + np.tanh((charge - edge) / 0.02))
    noise = np.random.default_rng(seed).standard_normal(len(SOC)) * noise_volt
    return curve_of(SOC, volt + noise, float(sum(charges)), cycle=cycle)


def test_boundaries_are_found_where_they_are():
    volt, charge, _ = boundaries(curve(0.4, 0.9, 0.7))
    assert charge == pytest.approx([0.4, 1.3], abs=0.01)
    assert volt == pytest.approx([3.25, 3.35], abs=0.02)


def test_loss_is_told_plateau_by_plateau():
    losses = plateau_losses([curve(0.4, 0.9, 0.7), curve(0.4, 0.85, 0.45, cycle=300.0)])
    found = [loss["loss_ampere_hour"] for loss in losses]
    assert found == pytest.approx([0.0, 0.05, 0.25], abs=0.015)
    assert [loss["share_of_loss"] for loss in losses] == pytest.approx(
        [0.0, 1 / 6, 5 / 6], abs=0.06
    )
    assert [loss["plateau"] for loss in losses] == [1, 2, 3]


def test_losses_add_up_to_that_of_the_curve():
    losses = plateau_losses([curve(0.4, 0.9, 0.7), curve(0.35, 0.8, 0.5, cycle=300.0)])
    assert sum(loss["loss_ampere_hour"] for loss in losses) == pytest.approx(0.35, abs=1e-9)


def test_interval_holds_under_noise():
    inside = []
    for seed in range(30):
        life = [
            curve(0.4, 0.9, 0.7, seed=seed, noise_volt=0.001),
            curve(0.4, 0.8, 0.6, cycle=300.0, seed=100 + seed, noise_volt=0.001),
        ]
        for loss, true in zip(plateau_losses(life), (0.0, 0.1, 0.1), strict=True):
            inside.append(
                abs(loss["loss_ampere_hour"] - true) < 1.96 * loss["loss_std_ampere_hour"]
            )
    assert np.mean(inside) >= 0.9


def test_a_boundary_that_moves_slowly_keeps_its_identity():
    """By 90 mV in three check-ups, more than lies between two boundaries of one check-up."""
    lives = [
        curve(0.4, 0.9, 0.7 - 0.05 * k, cycle=100.0 * k, volts=np.array(STEPS_VOLT) + 0.03 * k)
        for k in range(4)
    ]
    last = plateau_losses(lives)[-3:]
    assert [loss["loss_ampere_hour"] for loss in last] == pytest.approx([0, 0, 0.15], abs=0.015)


def test_a_boundary_that_is_gone_makes_its_plateaus_unknown():
    merged = curve(1.3, 0.5, cycle=300.0, volts=(3.2, 3.4))
    losses = plateau_losses([curve(0.4, 0.9, 0.7, volts=(3.2, 3.3, 3.4)), merged])
    assert not np.isfinite([loss["loss_ampere_hour"] for loss in losses]).all()
    assert any("not found at this check-up" in loss["reason"] for loss in losses)


def test_a_curve_without_plateaus_is_refused():
    straight = curve_of(SOC, 3.0 + SOC, 2.0)
    with pytest.raises(Refusal, match="dV/dQ has no maximum"):
        plateau_losses([straight, straight])
