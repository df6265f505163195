"""A cell without pulses: whose model it gets, by what it is corrected, and how sure that is."""

import numpy as np
import pytest
import truth
import type_of_cells

from cellwright.bias.compared import compared
from cellwright.bias.corrected import borrow_model
from cellwright.bias.correction import Change, _surer, correction
from cellwright.bias.courses import courses_of
from cellwright.bias.features import Shown
from cellwright.bias.thesis import quadratic_bias
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

LOSS, RATIO = 0.15, 1.32


def own(**settings):
    return type_of_cells.cell("X", LOSS, RATIO, **settings)


def errors(model, loss=LOSS, ratio=RATIO):
    """Relative errors of the resistance after 10 s, and of the OCV [V], over SoC."""
    found = courses_of(model, "2RC")
    true = courses_of(type_of_cells.model("X", loss, ratio), "2RC")
    inner = slice(1, -1)
    return (found.fast_ohm / true.fast_ohm - 1)[inner], (found.ocv_volt - true.ocv_volt)[inner]


def test_many_cells_give_the_true_model():
    reference, others = type_of_cells.drawn(20)
    model = borrow_model(own()._replace(model=None), [*others, reference]).content
    fast, ocv = errors(model)
    assert rms(fast) < 0.015
    assert rms(ocv) < 1e-3
    assert (model["kind"], model["cell"]) == ("bias", "X")
    assert model["capacity_ampere_hour"] == pytest.approx(truth.CAPACITY_AMPERE_HOUR * 0.85)
    assert "bias-corrected from R" in model["notes"][0]
    assert "calibrated on 20 cells" in model["notes"][0]
    assert any("leave-one-cell-out errors" in note for note in model["notes"])


def test_without_any_other_cell_the_charge_alone_tells_the_ocv():
    """What is left is what the onset's noise of 1 % makes of the polarisation."""
    reference, _ = type_of_cells.drawn(0)
    model = borrow_model(own()._replace(model=None), [reference]).content
    assert rms(errors(model)[1]) < 3e-3
    plain = borrow_model(own(charges=False)._replace(model=None), [reference]).content
    assert rms(errors(plain)[1]) > 5 * rms(errors(model)[1])
    assert (model["kind"], plain["kind"]) == ("bias", "scaled")
    assert "its own charge" in model["notes"][0]


@pytest.mark.slow
def test_intervals_hold_on_cells_that_were_not_used():
    inside, seeds = [], range(4)
    for seed in seeds:
        reference, cells = type_of_cells.drawn(24, seed)
        base, against = courses_of(reference.model, "2RC"), compared(reference, cells)
        for cell in against[12:]:
            found = correction(cell, base, against[:12])
            fast, _, ocv = found.changes
            for one, true in ((fast, cell.fast), (ocv, cell.ocv)):
                off = np.abs(one.change - true)
                inside.append((off <= one.half_interval + 1e-12)[1:-1])
    assert 0.90 <= np.mean(inside) <= 0.99


def test_a_cell_beyond_the_calibration_is_said_to_be_with_a_wider_interval():
    reference, cells = type_of_cells.drawn(15)
    base, others = courses_of(reference.model, "2RC"), compared(reference, cells)
    near, far = compared(reference, [own(), type_of_cells.cell("Y", 0.7, 3.5)])
    inner, outer = (correction(cell, base, others) for cell in (near, far))
    assert inner.outside == ()
    assert outer.outside[0].startswith("interval ")
    assert any("capacity differs by -1.2" in words for words in outer.outside)
    fast = inner.changes[0].half_interval, outer.changes[0].half_interval
    assert (fast[1] > 2 * fast[0]).all()
    model = borrow_model(far.shown._replace(model=None), [reference, *cells]).content
    assert any(note.startswith("outside the calibration") for note in model["notes"])


PEAKS = {3.5: 2.0, 3.7: 9.0}
R0_BIAS, OCV_BIAS = [0.5, 0.03, 0.01, -0.02], [0.03, 0.4, 0.03, 0.004]


def of_the_thesis(name, shift, **change):
    """A cell that differs from the reference as the thesis' eq. 4.3 and 4.5 have it."""
    peaks = [
        {"c_rate": 0.1, "voltage_volt": volt + shift, "height_ampere_hour_per_volt": height}
        for volt, height in PEAKS.items()
    ]
    model = type_of_cells.model(name, 0.0, 1.0)
    entry = model["members"][0]["conditions"][0]
    soc = np.asarray(entry["soc"])
    entry["r0_ohm"] = (np.asarray(entry["r0_ohm"]) + quadratic_bias(shift, soc, R0_BIAS)).tolist()
    entry["ocv_shift_volt"] = quadratic_bias(shift, soc, OCV_BIAS).tolist()
    return Shown(name, name == "R", 2.0, model, peaks, {})._replace(**change)


def test_the_thesis_functions_count_where_they_hold():
    others = [of_the_thesis(f"C{k}", s) for k, s in enumerate([0.02, 0.05, 0.09, 0.13, 0.15])]
    cell = of_the_thesis("X", 0.07)
    model = borrow_model(cell._replace(model=None), [of_the_thesis("R", 0.0), *others]).content
    found, true = (courses_of(one, "2RC") for one in (model, cell.model))
    np.testing.assert_allclose(found.fast_ohm, true.fast_ohm, rtol=2e-3)
    np.testing.assert_allclose(found.ocv_volt, true.ocv_volt, atol=3e-4)
    assert "the thesis' function" in model["notes"][0]


def bare(name, **change):
    """A cell that shows capacity and onset alone."""
    return Shown(name, False, 2.0, truth.model(name), [], {0.0: 0.05})._replace(**change)


BARE = bare("X", capacity_ampere_hour=1.7, model=None, onset_ohm={0.0: 0.06, 10.0: 0.12})


def r0_of(model):
    return model["members"][0]["conditions"][0]["r0_ohm"]


def test_the_capacities_of_the_reference_are_not_those_of_the_cell():
    aged = {"checkups": [{"cycle": 0}, {"cycle": 300}], "capacity_std_ampere_hour": 0.5}
    aged |= {"left_out_temperatures": [{"beyond": True}], "alike": [{}]}
    reference = bare("L", model=truth.model("L") | aged)
    model = borrow_model(BARE._replace(capacity_std_ampere_hour=0.02), [reference]).content
    assert not model.keys() & {"checkups", "left_out_temperatures", "alike"}
    assert model["capacity_std_ampere_hour"] == 0.02


def test_the_reference_is_the_first_marked_cell_else_the_largest():
    small, large = (
        bare("S", capacity_ampere_hour=1.9),
        bare("L", capacity_ampere_hour=2.1),
    )
    assert "scaled from L" in borrow_model(BARE, [small, large]).content["notes"][0]
    marked = small._replace(marked=True)
    assert "scaled from S" in borrow_model(BARE, [large, marked]).content["notes"][0]
    both = [marked, large._replace(marked=True)]
    assert "scaled from S" in borrow_model(BARE, both).content["notes"][0]


def test_too_few_to_calibrate_scales_by_the_onset_of_the_discharge():
    """At the longest delay that both show, 10 s: 0.12 over 0.08 ohm."""
    reference = bare("R", onset_ohm={0.0: 0.05, 10.0: 0.08, 30.0: 0.1})
    model = borrow_model(BARE, [reference]).content
    np.testing.assert_allclose(r0_of(model), 1.5 * truth.R0)
    assert (model["kind"], model["capacity_ampere_hour"]) == ("scaled", 1.7)
    assert "resistance by the onset of its discharges from full (10 s)" in model["notes"]
    assert any(note.startswith("0 cell(s) beside R can calibrate") for note in model["notes"])


def test_a_reference_without_an_onset_has_the_response_of_its_model():
    """10 s into a step at full its model has R0 and of each pair what has risen."""
    full = truth.R0[-1] + truth.R[:, -1] @ (1 - np.exp(-10.0 / truth.TAU))
    model = borrow_model(
        BARE._replace(onset_ohm={10.0: 1.3 * full}), [bare("R", onset_ohm={})]
    ).content
    np.testing.assert_allclose(r0_of(model), 1.3 * truth.R0)
    assert any("response of the reference's model" in note for note in model["notes"])


def test_without_an_onset_the_resistance_stays_and_is_said():
    model = borrow_model(BARE._replace(onset_ohm={}), [bare("R")]).content
    np.testing.assert_allclose(r0_of(model), truth.R0)
    assert "its resistance is not known: taken as the reference's" in model["notes"]


def test_an_onset_that_is_no_resistance_is_not_used_and_said():
    model = borrow_model(BARE._replace(onset_ohm={0.0: -0.01}), [bare("R")]).content
    np.testing.assert_allclose(r0_of(model), truth.R0)
    assert any("found -0.01 ohm at an onset" in note for note in model["notes"])


def with_member(cell, name):
    """The cell with its one member under another name, as the chosen one."""
    member = cell.model["members"][0] | {"model": name}
    return cell._replace(model=cell.model | {"members": [member], "chosen": name})


def test_only_cells_with_the_member_that_the_reference_has_chosen_calibrate():
    reference, others = type_of_cells.drawn(6)
    lacking = [*others[:5], with_member(others[5], "1RC")]
    model = borrow_model(own()._replace(model=None), [reference, *lacking]).content
    assert "calibrated on 5 cells" in model["notes"][0]
    other = lacking[5].model["members"][0]
    both = others[5].model | {"members": [other, *others[5].model["members"]], "chosen": "1RC"}
    model = borrow_model(
        own()._replace(model=None), [reference, *others[:5], others[5]._replace(model=both)]
    ).content
    assert "calibrated on 6 cells" in model["notes"][0]


@pytest.mark.parametrize(
    ("cell", "peers", "reason"),
    [
        (BARE, [], "no cell of the same chemistry and rating"),
        (BARE._replace(capacity_ampere_hour=0.0), [bare("R")], "capacity of X is 0.0 Ah"),
    ],
)
def test_what_cannot_be_borrowed_is_refused(cell, peers, reason):
    with pytest.raises(Refusal, match=reason):
        borrow_model(cell, peers)


def test_what_is_expected_beforehand_counts_where_terms_are_less_sure():
    wide, narrow = (
        Change(np.zeros(2), np.full(2, half), form, np.zeros((3, 2)), np.ones(3), 1.0)
        for half, form in ((2.0, "terms"), (1.0, "charge"))
    )
    assert _surer(narrow, wide).form == "charge"
    assert _surer(wide, narrow) is narrow
    unknown = narrow._replace(half_interval=np.full(2, np.nan))
    assert _surer(unknown, wide) is wide
