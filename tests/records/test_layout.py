"""One test on the SoC scale, against rows made by hand: anchor, mask, temperature, gaps."""

import numpy as np
import pytest
from sheets_facts import cell_facts, measured_test

from cellwright.records.filled import bridged
from cellwright.records.record import laid_out, laid_out_to_fit
from cellwright.refusal import Refusal

CELL = cell_facts(3.0, 4.2)
BASIS = {
    "capacity_ampere_hour": 2.0,
    "ocv": [{"ambient_temperature_celsius": 25.0, "soc": [0.0, 1.0], "ocv_volt": [3.0, 4.0]}],
}
# Three loads of 360 s at 1 A, 0.1 Ah or 5 % each, with a rest of 240 s behind each; a row a minute.
LOADS = np.tile([-1.0] * 6 + [0.0] * 4, 3)
TIME = 60.0 * np.arange(30)
CHARGE = -np.cumsum(np.append(0.0, -LOADS[:-1])) / 60.0


def made(role="fit", soc=0.8, kind="drive", rows=slice(None), celsius=25.0, **change):
    series = {
        "test_time_second": TIME,
        "current_ampere": LOADS,
        "voltage_volt": np.full(30, 3.7),
        "charge_ampere_hour": CHARGE,
    }
    series = {name: np.asarray(values)[rows] for name, values in (series | change).items()}
    return measured_test(series, "hand", kind, celsius=celsius, soc=soc, role=role)


def laid(test, **settings):
    return laid_out(test, BASIS, CELL, split_rest_second=120.0, **settings)


def test_columns_anchor_and_names_of_a_test():
    record = laid(made())
    assert (record.test, record.kind, record.role) == ("hand", "drive", "fit")
    assert record.anchor == "stated at the start"
    assert record.soc[0] == 0.8
    np.testing.assert_allclose(record.soc[[6, 9, 16, 26]], [0.75, 0.75, 0.70, 0.65])
    np.testing.assert_array_equal(record.current_ampere, LOADS)
    assert record.used.all()


def test_without_a_stated_soc_the_rest_voltage_at_the_start_tells():
    resting = LOADS * (TIME > 0)
    record = laid(made(soc=None, current_ampere=resting))
    assert record.anchor == "rest voltage at the start, by the OCV table"
    assert record.soc[0] == pytest.approx(0.7)


def test_a_split_test_is_fitted_in_odd_blocks_and_proves_in_even_ones():
    fit, proof = (laid(made("split"), proof=proof) for proof in (False, True))
    by_hand = np.repeat([True, False, True], 10)
    np.testing.assert_array_equal(fit.used, by_hand)
    np.testing.assert_array_equal(proof.used, ~by_hand)
    assert laid(made("fit"), proof=True).used.all()


def test_blocks_are_cut_by_the_cleaned_current_though_the_logged_one_is_taken():
    """A sensor reads 0.1 A too much: at that, no row of the logged current is at rest."""
    test = made("split", logged_current_ampere=LOADS + 0.1)
    record = laid(test, as_read=True)
    np.testing.assert_array_equal(record.used, np.repeat([True, False, True], 10))
    np.testing.assert_allclose(record.current_ampere, LOADS + 0.1)
    # 29 minutes at 0.1 A of 2 Ah that nothing but the sensor saw.
    more = record.soc - laid(test).soc
    assert more[-1] == pytest.approx(0.1 * 29 / 60 / 2.0)


@pytest.mark.parametrize(
    ("stated", "surface", "chamber", "celsius", "source"),
    [
        (5.0, np.arange(30.0), np.full(30, 4.0), np.arange(30.0), "the surface's measured"),
        (5.0, None, np.linspace(4, 6, 30), np.linspace(4, 6, 30), "the chamber's measured"),
        (5.0, np.full(30, np.nan), None, np.full(30, 5.0), "the chamber's"),
        (None, None, None, np.full(30, 25.0), "25 °C, for want of any"),
    ],
)
def test_the_temperature_is_the_surface_s_else_the_chamber_s(
    stated, surface, chamber, celsius, source
):
    names = ("surface_temperature_celsius", "ambient_temperature_celsius")
    given = {n: v for n, v in zip(names, (surface, chamber), strict=True) if v is not None}
    test = made(celsius=stated, **given)
    record = laid(test, as_read=True)
    np.testing.assert_array_equal(record.celsius, celsius)
    assert record.temperature_source == source
    if source == "the chamber's measured":
        np.testing.assert_array_equal(laid(test).celsius, stated)
        assert laid(test).temperature_source == "the chamber's"


@pytest.mark.parametrize("proof", [False, True])
def test_what_is_filled_into_a_gap_is_never_compared(proof):
    """Rows 11 to 15 are missing, and with them 6 A min of charge in a gap of 960 s."""
    time = np.where(np.arange(30) > 15, TIME + 600.0, TIME)
    torn = made("split", test_time_second=time, rows=np.r_[0:11, 16:30])
    whole = laid(torn, proof=proof)
    settings = {"split_rest_second": 120.0, "proof": proof}
    record = bridged(whole, capacity_ampere_hour=BASIS["capacity_ampere_hour"])
    fitted = laid_out_to_fit(torn, BASIS, CELL, **settings)
    assert fitted.used.sum() == whole.used.sum()
    assert len(record.soc) == len(whole.soc) + 4
    filled = slice(11, 15)
    assert not record.used[filled].any()
    np.testing.assert_array_equal(np.delete(record.used, np.arange(11, 15)), whole.used)
    moved = 6.0 / 60 / 2.0  # of the SoC, while nothing was logged
    np.testing.assert_allclose(record.soc[10] - record.soc[13], moved)
    np.testing.assert_allclose(record.current_ampere[filled], [-2.0, -2.0, -2.0, 0.0])
    np.testing.assert_array_equal(record.celsius, 25.0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rows": slice(0, 1)}, r"record has 1 sample\(s\)"),
        ({"voltage_volt": np.full(30, np.nan)}, "row 0 of voltage_volt is nan, not a number"),
        ({"test_time_second": TIME[::-1]}, "the clock runs back after row 0"),
        ({"soc": 1.2}, "stated SoC at the start is 1.2"),
        ({"soc": None}, "no state of charge: none is stated at the start"),
        ({"role": "split", "rows": slice(0, 6)}, "no rest of 120 s inside the record"),
    ],
)
def test_what_cannot_be_laid_out_is_refused_with_its_reason(change, reason):
    with pytest.raises(Refusal, match=reason):
        laid(made(**change))


@pytest.mark.parametrize(("soc", "run"), [(0.02, "-0.130 to 0.020"), (0.99, "0.990 to 1.140")])
def test_a_soc_beyond_the_scale_is_not_fitted_but_may_be_scored(soc, run):
    test = made(soc=soc, charge_ampere_hour=CHARGE if soc < 0.5 else -CHARGE)
    assert laid(test).soc[0] == soc
    with pytest.raises(Refusal, match=f"SoC of the record runs from {run}, outside"):
        laid_out_to_fit(test, BASIS, CELL, split_rest_second=120.0)
