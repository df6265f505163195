"""Law of the fade, knee and remaining cycles, on lives whose truth is known."""

import numpy as np
import pytest
from lives_made import kinked, life, noise, smooth

from cellwright.health.fade import courses, draws, fade_of, recovery
from cellwright.health.knee import knee_of
from cellwright.health.of_life import analysed
from cellwright.health.remaining import remaining_of
from cellwright.refusal import Refusal


def found_in(share, **more):
    fade = fade_of(life(share, **more))
    drawn = draws(fade, count=400)
    knee = knee_of(fade, drawn)
    return fade, drawn, knee, remaining_of(fade, drawn, knee, end_of_life=0.8)


@pytest.mark.parametrize(
    ("kind", "laws"),
    [
        ("straight", {"linear"}),
        ("root", {"square root", "power"}),
        ("power", {"power", "gradual acceleration"}),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_the_law_is_found(kind, laws, seed):
    share = smooth(kind, 300) + noise(np.random.default_rng(seed), 300)
    fade = found_in(share)[0]
    assert max(fade.log_evidence, key=fade.log_evidence.get) in laws


@pytest.mark.parametrize("kind", ["straight", "root", "power", "rise"])
@pytest.mark.parametrize("seed", range(3))
def test_no_knee_is_invented_on_a_smooth_life(kind, seed):
    share = smooth(kind, 400) + noise(np.random.default_rng(seed), 400, std=0.002, memory=0.8)
    knee = found_in(share)[2]
    assert np.isnan(knee["knee_cycle"])
    assert knee["knee_reason"].startswith("no knee")


@pytest.mark.parametrize("seed", range(8))
def test_a_knee_lies_within_its_interval(seed):
    random = np.random.default_rng(seed)
    at, ratio = random.uniform(0.4, 0.85), random.uniform(4, 10)
    width = random.uniform(0, 0.03)
    share = kinked(400, at, ratio=ratio, width=width) + noise(random, 400)
    knee = found_in(share)[2]
    assert np.isfinite(knee["knee_cycle"])
    assert knee["knee_lower_cycle"] <= 400 * at <= knee["knee_upper_cycle"]
    assert knee["knee_upper_cycle"] - knee["knee_lower_cycle"] < 0.4 * 400


def test_the_end_of_an_early_rise_is_no_knee():
    x = np.arange(1, 401) / 400
    share = 1 + 0.01 * np.minimum(x / 0.3, 1) - 0.12 * np.maximum(x - 0.3, 0)
    knee = found_in(share + noise(np.random.default_rng(0), 400))[2]
    assert np.isnan(knee["knee_cycle"])


def test_an_early_rise_is_told():
    share = smooth("rise", 400) + noise(np.random.default_rng(0), 400, std=5e-4)
    _, _, summary = analysed(life(share))
    true = 100 * (share.max() / share[0] - 1)
    assert summary["early_rise_percent"] == pytest.approx(true, abs=0.3)
    straight = smooth("straight", 400) + noise(np.random.default_rng(0), 400, std=5e-4)
    assert analysed(life(straight))[2]["early_rise_percent"] == 0


def test_recovery_after_rests_is_no_fade():
    """Each rest brings 2 % back, lost again in 5 discharges: the law is that between."""
    count, starts = 160, (40, 80, 120)
    cycle = np.arange(1, count + 1)
    back = sum(0.02 * np.exp(-(cycle - s) / 5) * (cycle >= s) for s in starts)
    hours = 3.0 * cycle + 72.0 * sum(cycle >= s for s in starts)
    share = smooth("straight", count, 0.1) + noise(np.random.default_rng(3), count, std=5e-4)
    fade, drawn, knee, _ = found_in(share + back, hours=hours)
    assert fade.recovery_cycles == 5
    assert fade.recovery_evidence > 20
    assert np.isnan(knee["knee_cycle"])
    assert recovery(fade).max() == pytest.approx(0.02, abs=0.003)
    course = np.median(courses(drawn, fade.points.share), axis=0)
    true = 1 - 0.1 * fade.points.cycle / count
    scale = fade.points.scale_ampere_hour / 3.0
    assert np.abs(scale * course - true).max() < 0.004


KINDS = ("straight", "root", "power", "rise")


@pytest.mark.slow
def test_remaining_cycles_lie_within_their_interval():
    """Of 16 lives, half with a knee ahead, at least 14 (a true 95 % gives fewer in 4 %)."""
    held, ends = 0, 250
    for seed in range(16):
        random = np.random.default_rng(seed)
        share = smooth(KINDS[seed % 4], ends)
        if seed % 2:
            share = kinked(ends, random.uniform(0.6, 0.95), ratio=random.uniform(2, 8), lost=0.2)
        end = np.flatnonzero(share <= 0.8 * share[0])
        true = (end[0] if len(end) else ends) + 1
        seen = int((0.5 if seed < 8 else 0.7) * true)
        share = share[:seen] + noise(random, seen)
        remaining = found_in(share)[3]
        upper = np.nan_to_num(remaining["remaining_upper_cycles"], nan=np.inf)
        held += remaining["remaining_lower_cycles"] <= true - seen <= upper
    assert held >= 14


def test_a_life_at_its_end_says_where_that_was():
    share = smooth("straight", 300, 0.3) + noise(np.random.default_rng(0), 300)
    remaining = found_in(share)[3]
    assert remaining["end_of_life_reached"]
    assert remaining["remaining_cycles"] == 0
    assert remaining["end_of_life_cycle"] == pytest.approx(200, abs=3)


def test_three_points_are_no_life():
    with pytest.raises(Refusal, match="3 comparable discharges"):
        fade_of(life([1.0, 0.99, 0.98]))


def test_of_hardly_any_fade_nothing_is_carried_forward():
    share = smooth("straight", 100, 0.01) + noise(np.random.default_rng(0), 100, std=2e-4)
    remaining = found_in(share)[3]
    assert np.isnan(remaining["remaining_cycles"])
    assert "not knowable" in remaining["remaining_reason"]


def test_capacity_that_grows_is_no_fade():
    share = 2 - smooth("straight", 100, 0.05) + noise(np.random.default_rng(0), 100)
    _, _, knee, remaining = found_in(share)
    assert np.isnan(remaining["remaining_cycles"])
    assert "capacity grows" in remaining["remaining_reason"]
    assert np.isnan(knee["knee_cycle"])


def test_scale_and_order_of_draws_change_nothing():
    share = smooth("power", 200) + noise(np.random.default_rng(0), 200)
    first, second = (analysed(life(factor * share))[2] for factor in (1.0, 10.0))
    assert first["law"] == second["law"]
    assert first["remaining_cycles"] == pytest.approx(second["remaining_cycles"], rel=1e-6)
    assert second["start_ampere_hour"] == pytest.approx(10 * first["start_ampere_hour"])


def test_every_discharge_has_its_row():
    share = smooth("straight", 60) + noise(np.random.default_rng(0), 60)
    columns, laws, _ = analysed(life(share))
    assert {len(values) for values in columns.values()} == {60}
    inside = columns["law_lower_ampere_hour"] <= columns["law_upper_ampere_hour"]
    assert inside.all()
    assert sum(row["chosen"] for row in laws) == 1
    assert sum(row["probability"] for row in laws) == pytest.approx(1)
