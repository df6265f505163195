"""Cells in parallel by the fast generator: Kirchhoff's laws, equal cells, equalising at rest."""

import numpy as np
import pytest

from virtual_lab import fast
from virtual_lab.behaviour import Rating
from virtual_lab.chamber import steady
from virtual_lab.protocols import Step

SOC = np.linspace(0, 1, 101)
OCV = 3.3 + 0.7 * SOC - 0.3 * np.exp(-20 * SOC) + 0.05 * np.tanh(10 * (SOC - 0.5))
CELL = fast.Cell(Rating(5.0, 2.5, 4.2), OCV, 5.0, 0.02, (0.01, 0.015), (5.0, 120.0))
WEAK = CELL._replace(
    capacity_ampere_hour=4.0,
    r0_ohm=0.035,
    kinetic_share=0.4,
    exchange_current_ampere=2.0,
    charge_asymmetry=0.15,
)
ROOM = steady(25.0)


def load(second=60, scale=10.0):
    random = np.random.default_rng(3)
    return np.column_stack(
        [np.arange(second + 1.0), np.append(0.0, random.normal(-0.2 * scale, scale, second))]
    )


STEPS = [
    Step("current", 0.0, 60.0, 5.0),
    Step("current", -15.0, 120.0, 5.0),
    Step("profile", load(), 60.0, 1.0),
    Step("current", 0.0, 600.0, 5.0),
]


def group(steps, cells, wires, soc, **settings):
    return fast.run_group(
        steps, cells, wire_ohm=wires, initial_soc=soc, chambers=[ROOM] * len(cells), **settings
    )


@pytest.fixture(scope="module")
def unequal():
    return group(STEPS, [CELL, WEAK, CELL], [0.001, 0.002, 0.004], [0.8, 0.85, 0.7])


def test_currents_add_up(unequal):
    for behaviour in unequal:
        t = np.linspace(0, behaviour.duration_second, 1001)
        total = sum(branch(t) for branch in behaviour.branches)
        np.testing.assert_allclose(total, behaviour.current(t), atol=1e-9)


@pytest.mark.parametrize(
    ("k", "cell", "wire", "soc"), [(1, WEAK, 0.002, 0.85), (2, CELL, 0.004, 0.7)]
)
def test_every_branch_shows_the_common_voltage(unequal, k, cell, wire, soc):
    """Each cell alone, with the current that it had in the group, behind its wire."""
    steps = []
    for behaviour in unequal:
        t = np.unique(behaviour.branches[k].keywords["xp"])
        ampere = behaviour.branches[k](t)
        steps.append(Step("profile", np.column_stack([t, ampere]), t[-1], 1.0))
    alone = fast.run(steps, cell, chamber=ROOM, initial_soc=soc)
    for behaviour, single in zip(unequal, alone, strict=True):
        t = np.linspace(0, behaviour.duration_second, 2001)
        volt = single.voltage(t) + wire * behaviour.branches[k](t)
        off = volt - behaviour.voltage(t)
        assert np.sqrt(np.mean(off**2)) < 2e-5
        # At the instants of the kernel itself the law is exact.
        t = steps[0].value[:, 0] if single is alone[0] else t[:1]
        volt = single.voltage(t) + wire * behaviour.branches[k](t)
        np.testing.assert_allclose(volt, behaviour.voltage(t), atol=1e-7)


def test_equal_cells_are_one_large_cell():
    n = 3
    large = CELL._replace(
        rating=CELL.rating._replace(capacity_ampere_hour=15.0),
        capacity_ampere_hour=n * 5.0,
        r0_ohm=(0.02 + 0.003) / n,
        pair_r_ohm=(0.01 / n, 0.015 / n),
    )
    steps = [*STEPS, Step("current", 15.0, 9000.0, 5.0, until_volt=3.95)]
    steps.append(Step("hold", 3.95, 9000.0, 5.0, until_ampere=2.0))
    together = group(steps, [CELL] * n, [0.003] * n, [0.8] * n)
    alone = fast.run(steps, large, chamber=ROOM, initial_soc=0.8)
    for many, single in zip(together, alone, strict=True):
        assert many.duration_second == pytest.approx(single.duration_second, abs=0.01)
        t = np.linspace(0, min(many.duration_second, single.duration_second), 501)
        np.testing.assert_allclose(many.voltage(t), single.voltage(t), atol=3e-6)
        np.testing.assert_allclose(many.charge(t), single.charge(t), atol=1e-4)
        for branch in many.branches:
            np.testing.assert_allclose(branch(t), many.current(t) / n, atol=1e-9)


def test_current_circulates_until_the_cells_are_equal():
    (rest,) = group([Step("current", 0.0, 40000.0, 60.0)], [CELL, WEAK], [0.001, 0.001], [0.9, 0.5])
    flows = rest.branches[0]
    begin = (np.interp(0.5, SOC, OCV) - np.interp(0.9, SOC, OCV)) / (0.021 + 0.001 + 0.035 * 1.15)
    # asinh lets a little more through than the slope at zero current.
    assert begin * 1.3 < flows(0.0) < begin
    assert abs(flows(40000.0)) < 1e-3
    passed = np.trapezoid(flows(np.arange(0.0, 40000.0)), dx=1.0) / 3600
    assert rest.soc(40000.0) == pytest.approx(0.9 + passed / 5.0, abs=1e-4)
    assert rest.charge(40000.0) == pytest.approx(0.0, abs=1e-12)
    weak = 0.5 - passed / 4.0
    open_circuit = np.interp([rest.soc(40000.0), weak], SOC, OCV)
    assert open_circuit[0] == pytest.approx(open_circuit[1], abs=1e-4)


def test_limits_are_those_of_the_group():
    steps = [
        Step("current", -20.0, 9000.0, 5.0, until_volt=3.0),
        Step("current", 10.0, 9000.0, 5.0, until_volt=4.0),
        Step("hold", 4.0, 36000.0, 30.0, until_ampere=1.0),
    ]
    down, up, held = group(steps, [CELL, WEAK], [0.001, 0.002], [0.9, 0.9])
    assert down.voltage(down.duration_second) == pytest.approx(3.0, abs=1e-7)
    assert up.voltage(up.duration_second) == pytest.approx(4.0, abs=1e-7)
    assert held.current(held.duration_second) == pytest.approx(1.0, abs=1e-7)
    t = np.linspace(0, held.duration_second, 501)
    np.testing.assert_allclose(held.voltage(t), 4.0, atol=1e-5)


def test_the_warmer_cell_takes_more():
    warm = CELL._replace(r0_activation_joule_per_mole=30e3)
    (down,) = fast.run_group(
        [Step("current", -10.0, 10.0, 1.0)],
        [warm, warm],
        wire_ohm=[0.0, 0.0],
        initial_soc=[0.5, 0.5],
        chambers=[steady(35.0), steady(15.0)],
    )
    r = 0.02 * np.exp(30e3 / 8.314462618 * (1 / np.array([308.15, 288.15]) - 1 / 298.15))
    expected = -10.0 * r[::-1] / r.sum()
    np.testing.assert_allclose([b(0.0) for b in down.branches], expected, rtol=1e-9)


def test_instant_hysteresis_of_a_group_does_not_chatter():
    """A jump that would turn its own current back is not made; else the branches never calm."""
    lags = CELL._replace(hysteresis_instant_volt=0.01)
    steps = [Step("current", 10.0, 60.0, 5.0), Step("current", 0.0, 3600.0, 60.0)]
    _, rest = group(steps, [lags, lags], [0.001, 0.001], [0.5, 0.56])
    t = np.linspace(100.0, 3600.0, 2000)
    flows = rest.branches[0](t)
    assert rest.current.keywords["xp"].size < 2000
    assert (np.abs(np.diff(flows)) < 0.02).all()


def test_numbers_must_agree():
    with pytest.raises(ValueError, match="differ in number"):
        group(STEPS, [CELL, CELL], [0.001], [0.5, 0.5])
