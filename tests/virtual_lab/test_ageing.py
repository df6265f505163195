"""Lives of the five types of cell, against what the thesis tells of them."""

import numpy as np
import pytest

from virtual_lab import ageing, electrodes

LIVES = [(kind, protocol) for kind in ageing.KINDS for protocol in ageing.PROTOCOLS]
CHECK_UPS = np.linspace(0.0, 1.0, 26)


def states(kind, protocol, shares=CHECK_UPS):
    last = ageing.last_cycle(kind, protocol)
    return np.array([ageing.state(kind, protocol, share * last) for share in shares])


def remaining(kind, protocol, cycle):
    """Capacity at rest [1] of the electrodes that are left, over the fresh ones'."""
    made = ageing.KINDS[kind]
    lost = ageing.state(kind, protocol, cycle)
    losses = {name: getattr(lost, name) for name in ("lli", "lam_negative", "lam_positive")}
    left = electrodes.window(made.chemistry, made.rating, **losses)
    fresh = electrodes.window(made.chemistry, made.rating)
    return left.capacity_ampere_hour / fresh.capacity_ampere_hour


@pytest.mark.parametrize(
    ("cycle", "told_ampere_hour"), [(0, 19.56), (200, 19.66), (1200, 16.0), (1250, 9.0)]
)
def test_capacity_of_the_ncm_cell(cycle, told_ampere_hour):
    """Section 4.3, cell EIG #3 (at 200 cycles #1, whose pattern was the same)."""
    found = ageing.KINDS["C"].fresh_ampere_hour * remaining("C", "standard", cycle)
    assert found == pytest.approx(told_ampere_hour, rel=0.001)


@pytest.mark.parametrize(("cycle", "told"), [(300, 0.95), (500, 0.92), (900, 0.83)])
def test_capacity_of_the_lfp_cell(cycle, told):
    """Figure 4.15."""
    assert remaining("B", "standard", cycle) == pytest.approx(told, abs=1e-6)


def test_resistance_of_the_ncm_cell():
    """+0.2 mΩ in 1100 cycles, +0.4 mΩ more until 1200, four times the fresh 2 mΩ at the end."""
    factors = [
        ageing.state("C", "standard", cycle).resistance_factor for cycle in (0, 900, 1100, 1200)
    ]
    ohm = ageing.KINDS["C"].fresh_ohm * np.array(factors)
    assert ohm - ohm[0] == pytest.approx([0.0, 0.0, 0.0002, 0.0006], abs=0.00003)
    assert ageing.state("C", "standard", 1250).resistance_factor == pytest.approx(4.0)


def test_knees():
    told = {("C", "standard"): 1200, ("C", "fast_charge"): 300, ("B", "standard"): 850}
    for life, cycle in told.items():
        assert ageing.knee_cycle(*life) == cycle
        before, knee, after = (ageing.capacity_share(*life, cycle + step) for step in (-50, 0, 50))
        assert knee - after > 1.2 * (before - knee)
    assert ageing.knee_cycle("C", "high_power") is None


@pytest.mark.parametrize(("kind", "protocol"), LIVES)
def test_a_cell_only_wears_after_its_early_rise(kind, protocol):
    life = states(kind, protocol)
    worn = CHECK_UPS >= 0.25
    assert (np.diff(life[worn, :4], axis=0) >= -1e-9).all()
    assert (np.diff(life[:, 4]) <= 1e-12).all()
    assert life[0] == pytest.approx([0, 0, 0, 1, 1], abs=1e-8)
    assert life[:, 0].min() > -0.01


@pytest.mark.parametrize(("kind", "protocol"), LIVES)
def test_losses_leave_the_capacity_that_is_told(kind, protocol):
    for cycle in (0.3, 0.7, 1.0) * np.array(ageing.last_cycle(kind, protocol)):
        share = ageing.capacity_share(kind, protocol, cycle)
        assert remaining(kind, protocol, cycle) == pytest.approx(share, abs=1e-7)


def test_there_is_no_state_beyond_the_last_cycle():
    with pytest.raises(ValueError, match="lived 0 to 1250 cycles, asked: 1300"):
        ageing.state("C", "standard", 1300)
