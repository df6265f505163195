"""Capacity between two rests: the truth within its interval, and each reason why there is none."""

import numpy as np
import pytest

import cellwright as cw

CELL = {"cell": "A", "rated_capacity_ampere_hour": 5.0}
SOC = np.linspace(0, 1, 201)
GAP, OHM = 0.008, 0.02
PAIRS = ((0.010, 60.0), (0.008, 1500.0))  # of the slower one 13 to 55 % are left after the rests


def nmc(soc):
    """Open-circuit voltage [V] that rises everywhere."""
    soc = np.asarray(soc, float)
    return 3.45 + 0.7 * soc + 0.06 * np.tanh((soc - 0.55) / 0.08) - 0.35 * np.exp(-soc / 0.04)


def lfp(soc):
    """Open-circuit voltage [V] with a plateau from 0.2 to 0.9."""
    soc = np.asarray(soc, float)
    return 3.3 + 0.003 * soc - 0.6 * np.exp(-soc / 0.03) + 0.2 * np.exp((soc - 1) / 0.015)


def basis(ocv, *, capacity=5.0, borrowed=None, back=None):
    """Basis of a cell with one slow test both ways."""
    curve = {
        **{"test": "slow", "ambient_temperature_celsius": 25.0, "cycle": None, "branches": "both"},
        **{"soc": SOC, "ocv_volt": ocv(SOC)},
        # Hysteresis, and the drop of the slow current over what relaxes within hours.
        "half_gap_volt": np.full(len(SOC), GAP + 0.25 * (OHM + sum(r for r, _ in PAIRS))),
        **{"charge_current_ampere": 0.25, "discharge_current_ampere": -0.25},
        "capacity_ampere_hour": capacity,
        "charge_capacity_ampere_hour": capacity if back is None else back,
    }
    return {"capacity_ampere_hour": capacity, "ocv": [curve], "borrowed_from": borrowed}


def record(seed, ocv, *, capacity, windows, rest=2400, lying=0.5, gain=1.0, current=2.5):
    """A record that rests, is brought to each SoC of `windows` in turn, and rests there.

    lying : share of the gap by which rests lie towards the branch of their load.
    """
    rng, every = np.random.default_rng(seed), 10.0
    # What was before the record, which nobody knows, was a charge or a discharge.
    soc, volts, rows, side = windows[0], np.zeros(len(PAIRS)), [], rng.choice([-1.0, 1.0])
    for target in windows:
        load = round(abs(target - soc) * capacity * 3600 / current / every)
        sign = np.sign(target - soc)
        for ampere in [sign * current] * load + [0.0] * int(rest / every):
            side = sign or side
            soc += ampere * every / 3600 / capacity
            tau = np.array([one[1] for one in PAIRS])
            r = np.array([one[0] for one in PAIRS])
            volts = r * ampere + (volts - r * ampere) * np.exp(-every / tau)
            volt = float(ocv(soc)) + lying * side * GAP + OHM * ampere + volts.sum()
            rows.append((gain * ampere, volt + 2e-4 * rng.standard_normal()))
    ampere, volt = np.array(rows).T
    time = every * np.arange(len(ampere))
    charge = np.cumsum(ampere) * every / 3600
    names = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")
    return dict(zip(names, (time, ampere, volt, charge), strict=True))


def found(series, known, **facts):
    """Row of the one test, whose facts may be changed."""
    about = {"test": "drive", "kind": "drive", "ambient_temperature_celsius": 25.0} | facts
    result = cw.capacity_between_rests([(about, series, cw.segment(series, CELL))], known)
    if isinstance(result.rows, dict):
        assert not any(len(column) for column in result.rows.values())
        (reason,) = result.notes
        raise cw.Refusal(reason)
    return result.rows[0]


def test_nine_of_ten_intervals_hold_the_capacity_of_a_worn_cell_by_its_own_curve():
    rng, off = np.random.default_rng(5), []
    for seed in range(40):
        begin, swing = rng.uniform(0.6, 0.95), rng.uniform(0.35, 0.55)
        series = record(
            seed,
            nmc,
            capacity=4.2,
            windows=(begin, begin - swing),
            rest=rng.uniform(900, 3600),
            lying=rng.uniform(0, 1),
            gain=1 + rng.uniform(-5e-4, 5e-4),
        )
        row = found(series, basis(nmc, capacity=4.2))
        off.append((row["capacity_ampere_hour"] - 4.2) / row["capacity_std_ampere_hour"])
        assert row["capacity_std_ampere_hour"] < 0.05 * 4.2
    assert np.mean(np.abs(off) < 1.96) >= 0.9
    assert np.std(off) > 0.3  # an interval that always holds would say nothing


def test_a_charge_tells_it_as_a_discharge_does_and_what_lies_between_is_held_against_both():
    series = record(1, nmc, capacity=4.6, windows=(0.2, 0.4, 0.65, 0.9))
    row = found(series, basis(nmc, capacity=4.6))
    assert row["charge_ampere_hour"] == pytest.approx(0.7 * 4.6, abs=0.02)
    assert row["rests"] == 4
    assert (row["soc_first"], row["soc_last"]) == pytest.approx((0.2, 0.9), abs=0.02)
    assert row["doubt"] == ""
    assert abs(row["capacity_ampere_hour"] - 4.6) < 2 * row["capacity_std_ampere_hour"]


def test_charge_that_was_not_counted_is_told_by_a_rest_between():
    series = record(1, nmc, capacity=5.0, windows=(0.2, 0.4, 0.65, 0.9))
    late = series["test_time_second"] > 7000
    lost = series | {"charge_ampere_hour": series["charge_ampere_hour"] + 0.5 * late}
    row, sound = found(lost, basis(nmc)), found(series, basis(nmc))
    assert "off the line of the two" in row["doubt"]
    assert row["capacity_std_ampere_hour"] > 3 * sound["capacity_std_ampere_hour"]


def test_a_worn_cell_by_a_fresh_curve_has_an_interval_for_what_its_rests_do_not_enclose():
    # Lithium is lost: charge between two voltages stays, the cell is empty sooner.
    def worn(soc):
        return nmc(0.15 + 0.85 * np.asarray(soc))

    series = record(1, worn, capacity=0.85 * 5.0, windows=(0.9, 0.3))
    row = found(series, basis(nmc, borrowed="fresh"))
    assert row["capacity_ampere_hour"] == pytest.approx(5.0, rel=0.04)
    assert row["largest_part"] == "ageing of the curve"
    assert abs(row["capacity_ampere_hour"] - 4.25) < 2 * row["capacity_std_ampere_hour"]
    own = found(series, basis(nmc))
    assert own["capacity_std_ampere_hour"] < row["capacity_std_ampere_hour"] / 3


def test_a_slow_test_whose_directions_differ_leaves_the_scale_open_by_that():
    series = record(1, nmc, capacity=5.0, windows=(0.9, 0.3))
    closed, open_ = (found(series, basis(nmc, back=back)) for back in (5.0, 4.5))
    added = open_["capacity_std_ampere_hour"] ** 2 - closed["capacity_std_ampere_hour"] ** 2
    assert np.sqrt(added) == pytest.approx(0.1 / np.sqrt(3) * 5.0, rel=0.05)


@pytest.mark.parametrize(
    ("ocv", "windows", "words"),
    [
        (lfp, (0.8, 0.4), "flat at SoC 0"),
        (nmc, (0.62, 0.6), r"only 0\.0\d+ of the SoC apart"),
        (nmc, (0.9,), r"it takes two of 10 min and more on the open-circuit voltage, 1 found"),
    ],
)
def test_rests_that_tell_no_capacity_are_refused_with_the_reason(ocv, windows, words):
    with pytest.raises(cw.Refusal, match=words):
        found(record(1, ocv, capacity=5.0, windows=windows), basis(ocv))


def test_short_rests_no_curve_and_its_own_curve_are_refused():
    series = record(1, nmc, capacity=5.0, windows=(0.9, 0.3), rest=300)
    with pytest.raises(cw.Refusal, match="open-circuit voltage, 0 found"):
        found(series, basis(nmc))
    series = record(1, nmc, capacity=5.0, windows=(0.9, 0.3))
    with pytest.raises(cw.Refusal, match="drive: no open-circuit voltage is known"):
        found(series, basis(nmc) | {"ocv": []})
    with pytest.raises(cw.Refusal, match="its own rests are the open-circuit voltage"):
        found(series, basis(nmc), test="slow")


@pytest.mark.parametrize(
    ("of_curve", "of_basis", "words"),
    [
        ("long load capacity_1C", "long load capacity_1C", "known under load alone"),
        ("rating", "rating", "scaled by the rating, which would come back"),
        ("discharge of cap at 1C", "rating", "scaled by the rating, which would come back"),
    ],
)
def test_a_curve_that_knows_no_capacity_is_refused(of_curve, of_basis, words):
    series = record(1, nmc, capacity=5.0, windows=(0.9, 0.3))
    known = basis(nmc)
    known["ocv"][0] |= {"branches": "rests", "capacity_source": of_curve}
    with pytest.raises(cw.Refusal, match=words):
        found(series, known | {"capacity_source": of_basis})
    # A slow test measured its own, whatever the sheet says of the cell that borrows it.
    own = basis(nmc, borrowed="fresh") | {"capacity_source": "rating"}
    assert found(series, own)["capacity_ampere_hour"] == pytest.approx(5.0, rel=0.05)


def test_a_current_of_the_wrong_sign_contradicts_the_rests():
    series = record(1, nmc, capacity=5.0, windows=(0.9, 0.3))
    turned = series | {name: -series[name] for name in ("current_ampere", "charge_ampere_hour")}
    with pytest.raises(cw.Refusal, match=r"\+3 Ah were counted .* contradict each other"):
        found(turned, basis(nmc))


def test_what_one_test_does_not_tell_costs_no_other():
    good = record(1, nmc, capacity=5.0, windows=(0.9, 0.3))
    short = record(1, nmc, capacity=5.0, windows=(0.9, 0.3), rest=300)
    tests = [
        ({"test": name, "kind": "drive"}, series, cw.segment(series, CELL))
        for name, series in (("a", short), ("b", good), ("c", short))
    ]
    result = cw.capacity_between_rests(tests, basis(nmc))
    assert [row["test"] for row in result.rows] == ["b"]
    assert len(result.notes) == 1
    assert result.notes[0].startswith("a, c: no capacity between two rests")
