"""Capacity from peaks of dQ/dV: known lives recovered, intervals that cover, each refusal."""

import numpy as np
import pytest

from cellwright.health.peaks.alike import matched, named_alike
from cellwright.health.peaks.calibration import peak_calibration, peak_charges
from cellwright.health.peaks.estimate import capacity_from_peaks, left_out_estimates
from cellwright.health.peaks.features import IdentifiedPeak, PeakCharge, features_of
from cellwright.refusal import Refusal

FRESH_AMPERE_HOUR = 20.0
# Cells whose peaks carry their names through the life.
NAMED = {*[f"C{k}" for k in range(9)], *[f"P{k}" for k in range(20)], "new"}
# Of each peak: place [V] and its motion, height [A h/V] and its loss, over the lost capacity.
PEAKS = {
    "1": (3.50, 0.10, 28.0, 0.3),
    "2": (3.68, 0.05, 30.0, 1.2),
    "3": (3.86, 0.12, 26.0, -0.1),
}


def charge_of(random, soh, cell="C1", size=1.0, offset=0.0, noise=0.01, **more):
    """A charge of a simulated cell: its peaks move and shrink in proportion to what it lost."""
    peaks = {}
    for name, (volt, motion, height, loss) in PEAKS.items():
        lost = 1 - soh
        measured = 1 + noise * random.standard_normal(2)
        tall = size * height * (1 - loss * lost) * measured[0]
        place = volt + offset + motion * lost + 0.001 * random.standard_normal()
        peaks[name] = IdentifiedPeak(place, tall, 0.15 * tall * measured[1])
    facts = {"cycle": round(1000 * (1 - soh)), "c_rate": 0.5, "temperature_celsius": 25.0}
    facts |= {"capacity_ampere_hour": size * soh * FRESH_AMPERE_HOUR, "test": "ica"} | more
    return PeakCharge(cell=cell, peaks=peaks, **facts)


def lives(seed, cells=6, sohs=(1.0, 0.95, 0.9, 0.83, 0.75)):
    """Charges of several cells of a type, which differ in size by 2 % and in offset by 2 mV."""
    random = np.random.default_rng(seed)
    return [
        charge_of(random, soh, f"C{k}", size, offset)
        for k in range(cells)
        for size, offset in [
            (1 + 0.02 * random.standard_normal(), 0.002 * random.standard_normal())
        ]
        for soh in sohs
    ]


def errors(found, name):
    return np.array(
        [
            getattr(one, name).capacity_ampere_hour / one.charge.capacity_ampere_hour - 1
            for one in found
        ]
    )


@pytest.mark.slow
def test_capacities_of_cells_never_seen_lie_in_their_intervals():
    held, missed = [], []
    for seed in range(4):
        found = left_out_estimates(lives(seed), most_terms=2)
        missed += [*errors(found, "without_cell")]
        held += [
            one.without_cell.lower_ampere_hour
            <= one.charge.capacity_ampere_hour
            <= one.without_cell.upper_ampere_hour
            for one in found
        ]
    assert np.sqrt(np.mean(np.square(missed))) < 0.015
    assert 0.90 <= np.mean(held) < 1


def test_a_charge_twice_as_large_of_a_type_twice_as_large_has_twice_the_capacity():
    charges = lives(5)
    doubled = [
        charge._replace(
            capacity_ampere_hour=2 * charge.capacity_ampere_hour,
            peaks={
                name: IdentifiedPeak(p.voltage_volt, *(2 * value for value in p[1:]))
                for name, p in charge.peaks.items()
            },
        )
        for charge in charges
    ]
    one, two = (
        capacity_from_peaks(of[0], of[1:], most_terms=2).capacity_ampere_hour
        for of in (charges, doubled)
    )
    assert two == pytest.approx(2 * one, rel=1e-9)


def test_the_order_of_the_calibration_does_not_matter():
    charges = lives(6)
    first = capacity_from_peaks(charges[0], charges[5:], most_terms=2)
    second = capacity_from_peaks(charges[0], charges[:4:-1], most_terms=2)
    assert first.capacity_ampere_hour == pytest.approx(second.capacity_ampere_hour, rel=1e-9)


def test_the_peak_that_tells_is_found():
    """Peaks 1 and 3 neither move nor shrink here: only peak 2 tells the capacity."""
    random = np.random.default_rng(7)
    charges = []
    for k in range(20):
        soh = 0.75 + 0.25 * random.random()
        charge = charge_of(random, soh, f"P{k}")
        still = charge_of(random, 1.0).peaks
        charges.append(charge._replace(peaks={**still, "2": charge.peaks["2"]}))
    _, found, notes = peak_calibration(charges, rated_ampere_hour=20.0, tracked=NAMED, most_terms=2)
    told = {one["identity"]: one for one in found}
    assert told["2"]["weight"] > 0.95
    assert (
        told["2"]["rms_alone"]
        < 0.015
        < 0.05
        < min(told["1"]["rms_alone"], told["2"]["rms_without"])
    )
    assert "the information is in peak 2 (" in notes[0]


def test_a_partial_charge_is_told_by_the_peaks_that_it_reaches():
    charges = lives(8)
    partial = charges[3]._replace(peaks={"3": charges[3].peaks["3"]})
    found = capacity_from_peaks(partial, charges[5:], most_terms=2)
    assert found.peaks_used == ["3"]
    assert abs(found.capacity_ampere_hour / partial.capacity_ampere_hour - 1) < 0.05
    whole = capacity_from_peaks(charges[3], charges[5:], most_terms=2)
    assert found.std_ampere_hour > whole.std_ampere_hour


def test_a_charge_of_unknown_capacity_is_told_and_not_calibrated_on():
    charges = lives(9)
    new = charges[2]._replace(cell="new", capacity_ampere_hour=np.nan)
    rows, *_ = peak_calibration([new, *charges], tracked=NAMED, most_terms=1)
    (told,) = [row for row in rows if row["cell"] == "new"]
    assert told["capacity_ampere_hour"] == pytest.approx(charges[2].capacity_ampere_hour, rel=0.05)
    assert np.isnan([told[n] for n in ("measured_ampere_hour", "left_out_error", "soh")]).all()
    assert told["charges"] == len(charges)


@pytest.mark.slow
def test_soh_refers_to_the_first_check_up_else_to_the_rating():
    used = [c._replace(cell=f"used {c.cell}") for c in lives(10, cells=5, sohs=(0.9,))]
    rows, *_ = peak_calibration([*lives(11), *used], rated_ampere_hour=20.0, most_terms=1)
    aged = [row for row in rows if row["soh_of"] == "first check-up, cycle 0"]
    assert len(aged) == 30
    assert all(row["fresh_ampere_hour"] == 20.0 for row in rows if row["soh_of"] == "rating")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"peaks": {}}, "no peaks"),
        (
            {"peaks": {"9": IdentifiedPeak(3.5, 28.0, 4.0)}},
            "its peaks (9) are in fewer than 4 charges calibrated on",
        ),
        ({"c_rate": 1.0}, "at 1C and 25 °C, 4 are needed; there are charges at 0.5C and 25 °C"),
        ({"temperature_celsius": 0.0}, "0 charge(s) of known capacity at 0.5C and 0 °C"),
    ],
)
def test_a_charge_unlike_those_calibrated_on_has_a_reason_and_no_number(changed, words):
    charges = lives(13)
    found = capacity_from_peaks(charges[0]._replace(**changed), charges[5:])
    assert words in found.reason
    assert np.isnan(found.capacity_ampere_hour)


def test_a_charge_outside_the_calibration_has_no_number():
    random = np.random.default_rng(14)
    charges = [c for c in lives(14) if c.capacity_ampere_hour > 17]
    found = capacity_from_peaks(charge_of(random, 0.4, "dying"), charges, most_terms=1)
    assert found.reason.startswith("outside the calibration")
    assert np.isnan(found.capacity_ampere_hour)


def test_a_calibration_of_two_cells_has_no_interval_for_a_third():
    charges = lives(16, cells=3)
    other = capacity_from_peaks(charges[0], charges[5:], most_terms=1)
    own = capacity_from_peaks(charges[7], charges[:7] + charges[8:], most_terms=1)
    assert np.isfinite(other.capacity_ampere_hour)
    assert np.isnan(other.std_ampere_hour)
    assert "2 other cell(s)" in other.reason
    assert np.isfinite(own.std_ampere_hour)


def test_too_few_known_capacities_are_refused():
    with pytest.raises(Refusal, match="3 charge\\(s\\) of known capacity among 3"):
        peak_calibration(lives(17)[:3])


def test_of_four_charges_none_can_be_left_out_and_no_error_is_told():
    _, _, notes = peak_calibration(lives(17, cells=1)[:4], tracked=NAMED, most_terms=1)
    assert "no check-up was left out, its error is unknown" in notes[0]
    assert "nan" not in notes[0]


def test_a_check_up_is_left_out_whole():
    """A second charge of the same check-up must not tell the first one's capacity."""
    charges = lives(18, cells=1)
    twice = [*charges, charges[2]._replace(test="ica again")]
    found = left_out_estimates(twice, most_terms=1)
    assert {one.without_check_up.charges for one in found} == {5, 4}
    assert found[2].without_check_up.charges == 4


def test_features_hold_the_charge_between_two_peaks():
    volt = np.linspace(3.3, 4.0, 701)
    curve = np.full(701, 10.0)
    charge = lives(19)[0]._replace(voltage_volt=volt, dq_dv_ampere_hour_per_volt=curve)
    found = features_of([charge])
    value = found.values[0, found.names.index(("charge", "1", "2"))]
    apart = charge.peaks["2"].voltage_volt - charge.peaks["1"].voltage_volt
    assert np.exp(value) == pytest.approx(10 * apart, rel=1e-6)


def test_a_window_that_begins_late_leaves_out_the_area_that_it_cuts():
    curve = {"dq_dv_ampere_hour_per_volt": np.ones(50)}
    whole = [c._replace(voltage_volt=np.linspace(3.3, 4.0, 50), **curve) for c in lives(20)[:3]]
    cut = whole[0]._replace(voltage_volt=np.linspace(3.45, 4.0, 50))
    found = features_of([*whole, cut])
    first, last = ([n[:2] for n in found.names].index(("area", name)) for name in ("1", "3"))
    assert np.isnan(found.values[3, first])
    assert np.isfinite(found.values[3, last])


@pytest.mark.slow
def test_intervals_of_partial_charges_allow_for_how_surely_their_peaks_are_placed():
    """The peak beside the edge of a window is placed to 8 mV, those calibrated on to 1 mV."""
    held, wider = [], []
    window = {"dq_dv_ampere_hour_per_volt": np.ones(50)}
    for seed in range(25):
        random = np.random.default_rng(100 + seed)
        whole = [c._replace(voltage_volt=np.linspace(3.3, 4.0, 50), **window) for c in lives(seed)]
        new = charge_of(random, random.uniform(0.78, 0.98), "new")
        peak = new.peaks["3"]._replace(voltage_std_volt=0.008)
        moved = peak.voltage_volt + 0.008 * random.standard_normal()
        peaks = {"3": peak._replace(voltage_volt=moved)}
        cut = new._replace(peaks=peaks, voltage_volt=np.linspace(3.75, 4.0, 50), **window)
        sure = cut._replace(peaks={"3": peaks["3"]._replace(voltage_std_volt=0.0)})
        found, naive = (capacity_from_peaks(one, whole, most_terms=2) for one in (cut, sure))
        if np.isfinite(found.std_ampere_hour):
            held.append(
                found.lower_ampere_hour <= new.capacity_ampere_hour <= found.upper_ampere_hour
            )
            wider.append(found.std_ampere_hour > naive.std_ampere_hour)
    assert len(held) > 15
    assert np.mean(held) >= 0.9
    assert np.mean(wider) > 0.9


def test_an_area_is_compared_only_between_the_same_neighbours():
    charges = lives(21)[:2]
    fewer = charges[1]._replace(peaks={n: p for n, p in charges[1].peaks.items() if n != "2"})
    names = features_of([charges[0], fewer]).names
    assert ("area", "3", "2") in names
    assert ("area", "3", "1") in names


def test_peaks_are_matched_after_a_common_shift():
    known = [(3.50, 3.3), (3.68, 3.4), (3.86, 3.2)]
    found = [(3.55, 3.3), (3.91, 3.2)]
    pairs, shift = matched(known, found)
    assert pairs == [(0, 0), (2, 1)]
    assert shift == pytest.approx(0.05, abs=0.005)
    assert matched(known, []) == ([], 0.0)


def test_peaks_get_the_same_names_in_all_cells_though_some_vanish():
    """Numbered from low voltage a charge without its second peak calls the third the second."""
    charges = []
    for charge in lives(22, cells=3):
        peaks = dict(charge.peaks)
        if charge.cycle >= 170:
            del peaks["2"]
        renumbered = dict(zip("123", peaks.values(), strict=False))
        charges.append((charge._replace(peaks=renumbered), list(peaks)))
    named = named_alike([charge for charge, _ in charges])
    assert [list(charge.peaks) for charge in named] == [names for _, names in charges]


def test_tracked_names_of_one_cell_are_carried_to_the_others():
    """A peak that splits off late in a life keeps the name that its tracking gave it."""
    charges = lives(24, cells=2)
    words = {"1": "graphite 4-3 / P1", "2": "graphite 2-1 / P2", "3": "P3"}
    tracked = [
        c._replace(peaks={words[n]: p for n, p in c.peaks.items() if n != "3" or c.cycle > 0})
        for c in charges[:5]
    ]
    named = named_alike([*tracked, *charges[5:]], {"C0"})
    assert [list(c.peaks) for c in named[1:]] == [[*words.values()]] * 9
    assert list(named[0].peaks) == ["graphite 4-3 / P1", "graphite 2-1 / P2"]


def test_the_capacity_of_a_charge_in_a_life_is_that_of_its_own_cycle():
    peak = {"cell": "C1", "test": "life", "ambient_temperature_celsius": None, "c_rate": 0.5}
    peak |= {"voltage_volt": 3.5, "height_ampere_hour_per_volt": 20.0, "area_ampere_hour": 5.0}
    size = {"cell": "C1", "ambient_temperature_celsius": None, "direction": "discharge"}
    cycled = size | {"test": "life", "c_rate": 1.0, "of_a_life": True}
    sizes = [cycled | {"cycle": n, "capacity_ampere_hour": 1.1 - 0.001 * n} for n in (10, 20)]
    sizes.append(size | {"test": "capacity", "cycle": 10, "c_rate": 0.5, "capacity_ampere_hour": 9})
    peaks = [peak | {"cycle": n, "identity": "P1"} for n in (10, 20)]
    found = peak_charges(peaks, sizes, {("C1", "life", 20.0): (np.arange(3.0), np.ones(3))})
    assert [charge.capacity_ampere_hour for charge in found] == [1.1 - 0.01, 1.1 - 0.02]
    assert [len(charge.voltage_volt) for charge in found] == [0, 3]


def test_capacities_are_those_of_the_check_up_at_the_usual_rate():
    peak = {"cell": "C1", "ambient_temperature_celsius": 25.0, "c_rate": 0.5, "voltage_volt": 3.5}
    peak |= {"height_ampere_hour_per_volt": 20.0, "area_ampere_hour": 5.0}
    size = {"cell": "C1", "ambient_temperature_celsius": 25.0, "direction": "discharge"}
    peaks = [peak | {"test": f"ica_{n}", "cycle": n} for n in (None, 100, 200)]
    sizes = [
        size | {"cycle": None, "c_rate": 0.5, "capacity_ampere_hour": 20.0},
        size | {"cycle": 100, "c_rate": 0.5, "capacity_ampere_hour": 19.0},
        size | {"cycle": 100, "c_rate": 2.0, "capacity_ampere_hour": 17.0},
        size | {"cycle": 100, "c_rate": 0.5, "capacity_ampere_hour": 18.0, "direction": "charge"},
    ]
    found = {charge.cycle: charge.capacity_ampere_hour for charge in peak_charges(peaks, sizes, {})}
    assert found[0] == 20.0
    assert found[100] == 19.0
    assert np.isnan(found[200])


@pytest.mark.slow
def test_a_check_up_whose_capacity_disagrees_is_named_and_not_calibrated_on():
    """A discharge that was cut short must not bend the calibration of its neighbours."""
    charges = lives(23)
    cut = charges[7]._replace(capacity_ampere_hour=0.88 * charges[7].capacity_ampere_hour)
    rest = [*charges[:7], *charges[8:]]
    changed, _, notes = peak_calibration([*rest, cut], tracked=NAMED, most_terms=1)
    without, *_ = peak_calibration(rest, tracked=NAMED, most_terms=1)
    (told,) = [row for row in changed if "disagree by" in row["reason"]]
    assert (told["cell"], told["cycle"]) == (cut.cell, cut.cycle)
    assert told["left_out_error"] > 0.08
    others = {(row["cell"], row["cycle"]): row["capacity_ampere_hour"] for row in changed}
    for row in without:
        expected = pytest.approx(row["capacity_ampere_hour"], rel=1e-9)
        assert others[row["cell"], row["cycle"]] == expected
    assert "not calibrated on, since capacity and peaks disagree: C1 at cycle 100" in notes[0]


def test_the_smallest_capacity_of_all_is_calibrated_on_though_it_seems_off():
    """At the end of life the others are carried on, and that may fail: no reason to distrust it."""
    charges = lives(25)
    last = charges[4]._replace(capacity_ampere_hour=0.8 * charges[4].capacity_ampere_hour)
    rows, *_ = peak_calibration([*charges[:4], last, *charges[5:]], tracked=NAMED, most_terms=1)
    assert not any("disagree by" in row["reason"] for row in rows)
