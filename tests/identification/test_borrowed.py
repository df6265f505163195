"""A cell without pulses: whose model it gets, and that shifts of peaks or onsets correct it."""

import numpy as np
import pytest
import truth

from cellwright.identification.borrowed import Shown, borrowed_model, quadratic_bias
from cellwright.refusal import Refusal

R0_BIAS, OCV_BIAS, RP_BIAS = [0.5, 0.03, 0.01, -0.02], [0.03, 0.4, 0.03, 0.004], 0.27
PEAKS = {3.5: 2.0, 3.7: 9.0}


def peaks(shift=0.0, rate=0.1):
    return [
        {"c_rate": rate, "voltage_volt": volt + shift, "height_ampere_hour_per_volt": height}
        for volt, height in PEAKS.items()
    ]


def true_model(name, shift):
    """The reference's model, changed by the bias functions as thesis eq. 4.3 has it."""
    model = truth.model(name)
    entry = model["members"][0]["conditions"][0]
    entry["r0_ohm"] = (truth.R0 + quadratic_bias(shift, truth.KNOTS, R0_BIAS)).tolist()
    ratio = 1 + RP_BIAS * shift / truth.R.sum(axis=0)
    for branch, r in zip(entry["branches"], truth.R, strict=True):
        branch["r_ohm"] = (ratio * r).tolist()
    entry["ocv_shift_volt"] = quadratic_bias(shift, truth.KNOTS, OCV_BIAS).tolist()
    return model


def shown(name, shift=0.0, *, marked=False, capacity=2.0, **change):
    cell = Shown(name, marked, capacity, true_model(name, shift), peaks(shift), {0.0: 0.05})
    return cell._replace(**change)


OWN = Shown("X", False, 1.7, None, peaks(0.06), {0.0: 0.06, 10.0: 0.12})


def entry_of(model):
    return model["members"][0]["conditions"][0]


def test_peaks_give_the_true_model_where_enough_cells_calibrate():
    others = [shown(f"C{k}", shift) for k, shift in enumerate([0.02, 0.05, 0.09, 0.15])]
    model = borrowed_model(OWN, [*others, shown("R", marked=True)])
    entry, true = entry_of(model), entry_of(true_model("X", 0.06))
    np.testing.assert_allclose(entry["r0_ohm"], true["r0_ohm"], rtol=2e-3)
    np.testing.assert_allclose(
        entry["branches"][1]["r_ohm"], true["branches"][1]["r_ohm"], rtol=1e-2
    )
    np.testing.assert_allclose(entry["ocv_shift_volt"], true["ocv_shift_volt"], atol=2e-4)
    assert (model["kind"], model["cell"], model["capacity_ampere_hour"]) == ("bias", "X", 1.7)
    assert "leave-one-cell-out errors" in model["notes"][1]


def test_the_reference_is_the_first_marked_cell_else_the_largest():
    small, large = shown("S", capacity=1.9), shown("L", capacity=2.1)
    assert "scaled from L" in borrowed_model(OWN, [small, large])["notes"][0]
    marked = small._replace(marked=True)
    assert "scaled from S" in borrowed_model(OWN, [large, marked])["notes"][0]
    both = [marked, large._replace(marked=True)]
    assert "scaled from S" in borrowed_model(OWN, both)["notes"][0]


def test_too_few_to_calibrate_scales_by_the_onset_of_the_discharge():
    """At the longest delay that both show, 10 s: 0.12 over 0.08 ohm."""
    reference = shown("R", onset_ohm={0.0: 0.05, 10.0: 0.08, 30.0: 0.1})
    model = borrowed_model(OWN, [reference])
    np.testing.assert_allclose(entry_of(model)["r0_ohm"], 1.5 * truth.R0)
    assert (model["kind"], model["capacity_ampere_hour"]) == ("scaled", 1.7)
    assert "resistance by the onset of its discharges from full (10 s)" in model["notes"]
    assert any(note.startswith("not by IC peaks: 0 cell(s) beside") for note in model["notes"])


def test_without_a_common_onset_the_resistance_stays_and_is_said():
    model = borrowed_model(OWN._replace(onset_ohm={5.0: 1.0}), [shown("R")])
    np.testing.assert_allclose(entry_of(model)["r0_ohm"], truth.R0)
    assert "its resistance is not known: taken as the reference's" in model["notes"]


@pytest.mark.parametrize("own", [peaks(0.06, rate=1.0), []])
def test_peaks_at_another_rate_do_not_compare(own):
    model = borrowed_model(OWN._replace(peaks=own), [shown("R")])
    assert "not by IC peaks: X and R have no IC peaks at the same rate" in model["notes"]


def test_peers_without_comparable_peaks_do_not_calibrate():
    others = [shown(f"C{k}", shift) for k, shift in enumerate([0.02, 0.05, 0.09])]
    blind = others[2]._replace(peaks=peaks(0.09, rate=1.0))
    model = borrowed_model(OWN, [*others[:2], blind, shown("R", marked=True)])
    assert any("2 cell(s) beside the reference" in note for note in model["notes"])


def with_member(cell, name):
    """The cell with its one member under another name, as the chosen one."""
    member = cell.model["members"][0] | {"model": name}
    return cell._replace(model=cell.model | {"members": [member], "chosen": name})


def test_cells_compare_by_the_member_that_the_reference_has_chosen():
    """A peer that has it calibrates whatever its own choice; one that lacks it does not."""
    others = [shown(f"C{k}", shift) for k, shift in enumerate([0.02, 0.05, 0.09])]
    reference, lacking = shown("R", marked=True), with_member(others[2], "1RC")
    model = borrowed_model(OWN, [*others[:2], lacking, reference])
    assert any("2 cell(s) beside the reference" in note for note in model["notes"])
    other = {"model": "1RC", "conditions": [entry_of(truth.model())]}
    both = others[2].model | {"members": [other, *others[2].model["members"]], "chosen": "1RC"}
    model = borrowed_model(OWN, [*others[:2], others[2]._replace(model=both), reference])
    true = entry_of(true_model("X", 0.06))
    np.testing.assert_allclose(entry_of(model)["r0_ohm"], true["r0_ohm"], rtol=2e-3)


def test_the_ocv_of_cells_is_compared_where_their_models_read_it():
    """The same OCV over SoC, written as a table that is read with what a full charge left out."""
    others = [shown(f"C{k}", shift) for k, shift in enumerate([0.02, 0.05, 0.09, 0.15])]
    table = others[0].model["ocv"][0]
    volt = np.interp(truth.OCV_SOC, truth.OCV_SOC - 0.02, table["ocv_volt"])
    others[0].model["ocv"] = [table | {"ocv_volt": volt.tolist()}]
    read = entry_of(others[0].model) | {"ocv_scale": {"missing": 0.02, "stretch": 0.0}}
    others[0].model["members"][0]["conditions"] = [read]
    entry = entry_of(borrowed_model(OWN, [*others, shown("R", marked=True)]))
    true = entry_of(true_model("X", 0.06))
    np.testing.assert_allclose(entry["ocv_shift_volt"], true["ocv_shift_volt"], atol=2e-4)


def test_no_peer_is_refused():
    with pytest.raises(Refusal, match="no cell of the same chemistry and rating"):
        borrowed_model(OWN, [])
