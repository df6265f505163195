"""What a cell shows against its reference: by name, only what both show."""

import numpy as np
import pytest
import type_of_cells

from cellwright.bias.features import differences, peak_pairs, resistance_ratio
from cellwright.refusal import Refusal

R, C = type_of_cells.cell("R", 0.0, 1.0, noise=0.0), type_of_cells.cell("C", 0.2, 1.5, noise=0.0)


def peaks(*places, rate=0.5):
    names = ("voltage_volt", "height_ampere_hour_per_volt")
    return [{"c_rate": rate} | dict(zip(names, place, strict=True)) for place in places]


def test_capacity_tests_and_onsets_tell_size_and_resistance():
    found = differences(R, C)[0]
    assert found["capacity"] == pytest.approx(np.log(0.8))
    assert found["gap of charge and discharge"] == pytest.approx(np.log(1.5))
    assert found["share charged at the held voltage"] == pytest.approx(0.025)
    assert found["warming in the discharge"] == 0
    assert found["onset of discharge at 10 s"] == pytest.approx(
        np.log(C.onset_ohm[10.0] / R.onset_ohm[10.0])
    )
    assert "onset of charge at 10 s" in found


def test_the_course_of_the_charge_is_compared_at_shares_of_each_capacity():
    found = differences(R, C)[1]
    more = type_of_cells.CURRENT_AMPERE * 0.5 * 0.058
    true = type_of_cells.ocv_change(0.2, 0.5) + more
    assert found["voltage of the charge at 50 %"] == pytest.approx(true, abs=1e-3)
    assert found["mean voltage of the discharge"] == pytest.approx(0.02 - 0.045, abs=1e-9)


def test_the_same_peak_is_compared_though_one_is_missing():
    """The middle peak of three has vanished: places and heights of the outer two are compared."""
    reference = R._replace(peaks=peaks((3.5, 5.0), (3.7, 9.0), (3.9, 4.0)))
    other = C._replace(peaks=peaks((3.53, 4.5), (3.935, 4.2)))
    assert [number for number, _, _ in peak_pairs(reference, other)] == [1, 3]
    found = differences(reference, other)[0]
    assert found["place of peak 1"] == pytest.approx(0.03)
    assert found["height of peak 3"] == pytest.approx(np.log(4.2 / 4.0))
    assert "place of peak 2" not in found


@pytest.mark.parametrize("own", [[], peaks((3.5, 5.0), rate=1.0)])
def test_peaks_of_another_rate_or_none_do_not_compare(own):
    reference = R._replace(peaks=peaks((3.5, 5.0)))
    with pytest.raises(Refusal, match="C and R have no IC peaks at the same rate"):
        peak_pairs(reference, C._replace(peaks=own))
    assert not [n for n in differences(reference, C._replace(peaks=own))[0] if "peak" in n]


def test_what_only_one_cell_shows_is_left_out():
    bare = C._replace(onset_ohm={}, begin_ohm={}, capacities=(), charges=())
    found = differences(R, bare)
    assert (list(found[0]), found[1]) == (["capacity"], {})
    assert resistance_ratio(R, bare) == (
        1.0,
        "its resistance is not known: taken as the reference's",
    )


def test_a_value_that_is_not_known_is_no_feature():
    rows = tuple(row | {"temperature_mean_celsius": None} for row in C.capacities)
    assert "warming in the discharge" not in differences(R, C._replace(capacities=rows))[0]


def test_tests_at_another_temperature_are_not_compared():
    rows = tuple(row | {"ambient_temperature_celsius": 0.0} for row in C.capacities)
    assert not [n for n in differences(R, C._replace(capacities=rows))[0] if "gap" in n]
