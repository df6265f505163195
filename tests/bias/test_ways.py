"""Four ways side by side: the order of their errors, intervals, what cannot be compared."""

import numpy as np
import pytest
import truth
import type_of_cells

from cellwright.bias.ways import Scored, compare_bias_ways
from cellwright.bias.worst import corrected_voltages, worst_corrected
from cellwright.records.facts import CellFacts, MeasuredTest, TestFacts
from cellwright.refusal import Refusal

FACTS = {"rated_capacity_ampere_hour": 2.0, "lower_cutoff_volt": 2.5, "upper_cutoff_volt": 4.2}


def scored(shown, loss, ratio, **change):
    """A cell with a drive as its true model would show it, and that model as its own."""
    time, current = truth.drive(np.random.default_rng(7), 3000)
    current = 0.6 * current
    size = truth.CAPACITY_AMPERE_HOUR * (1 - loss)
    charge = np.append(0.0, np.cumsum(np.diff(time) * (current[1:] + current[:-1]) / 7200))
    soc = 0.95 + charge / size
    more = type_of_cells.ocv_change(loss, soc)
    volt = truth.voltage(time, current, soc, shift=more, resistance_factor=ratio)
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    series |= {"charge_ampere_hour": charge}
    test = MeasuredTest(TestFacts("drive", "drive", 25.0, None, 0.95, "validation"), series)
    facts = CellFacts(shown.cell, **FACTS)
    return Scored(shown, shown.model, facts, (test,))._replace(**change)


def cells(count):
    random = np.random.default_rng(4)
    traits = [(0.0, 1.0)]
    for loss in random.uniform(0.02, 0.3, count):
        traits.append((loss, (1 + 2 * loss) * np.exp(random.normal(0, 0.04))))
    return [
        scored(type_of_cells.cell(f"C{k}", *trait, marked=k == 0), *trait)
        for k, trait in enumerate(traits)
    ]


@pytest.fixture(scope="module")
def compared():
    return compare_bias_ways(cells(8), split_rest_second=60.0)


def mean_of(rows, way, column, count=None):
    chosen = [r[column] for r in rows if r["way"] == way]
    if count is not None:
        chosen = [r[column] for r in rows if (r["way"], r["calibrating_cells"]) == (way, count)]
    return np.mean(chosen)


def test_the_correction_errs_less_than_the_reference_scaled_or_not(compared):
    rows = compared.rows
    assert {row["cell"] for row in rows} == {f"C{k}" for k in range(1, 9)}
    means = [mean_of(rows, way, "rmse_volt") for way in ("reference", "scaled", "bias", "own")]
    assert min(means[:2]) > 5 * means[2] > 5 * means[3]
    assert means[2] < 3e-3


def test_a_cell_takes_no_part_in_its_own_calibration(compared):
    """Another model identified of a cell changes what the others get, and nothing that it gets."""
    rows = compared.rows
    other = cells(8)
    wrong = type_of_cells.model("C3", 0.5, 4.0)
    other[3] = other[3]._replace(shown=other[3].shown._replace(model=wrong))
    again = compare_bias_ways(other, split_rest_second=60.0).rows
    bias = [(a, b) for a, b in zip(rows, again, strict=True) if a["way"] == "bias"]
    changed = {a["cell"] for a, b in bias if a["rmse_volt"] != b["rmse_volt"]}
    assert changed == {f"C{k}" for k in range(1, 9)} - {"C3"}


def test_more_calibrating_cells_err_less_and_the_interval_is_stated(compared):
    rows = compared.rows
    assert {r["calibrating_cells"] for r in rows if r["way"] == "bias_of_few"} == {0, 3, 5}
    assert mean_of(rows, "bias", "rmse_volt") <= mean_of(rows, "bias_of_few", "rmse_volt", 0)
    assert mean_of(rows, "bias", "share_within") > 0.9
    assert 0 < mean_of(rows, "bias", "half_interval_volt") < 0.03
    assert np.isnan(mean_of(rows, "own", "share_within"))
    assert abs(mean_of(rows, "bias", "r10_error_soc_50")) < 0.03


def test_a_test_that_cannot_be_scored_is_named_and_takes_no_other_down():
    broken = cells(3)
    series = broken[1].tests[0].series | {"voltage_volt": np.full(3000, np.nan)}
    bad = MeasuredTest(broken[1].tests[0].facts, series)
    broken[1] = broken[1]._replace(tests=(bad, *broken[1].tests))
    found = compare_bias_ways(broken, split_rest_second=60.0)
    rows, notes = found.rows, found.notes
    assert len([row for row in rows if row["cell"] == "C1" and row["way"] == "own"]) == 1
    assert any(note.startswith("C1, drive: row 0 of voltage_volt is nan") for note in notes)


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(Refusal, match=r"1 cell.s. of this type have a model; wanted two"):
        compare_bias_ways(cells(0), split_rest_second=60.0)
    untested = [cell._replace(tests=()) for cell in cells(1)]
    with pytest.raises(Refusal, match="no test could be compared: none was given"):
        compare_bias_ways(untested, split_rest_second=60.0)


def row(cell, way, rmse_volt):
    return {"cell": cell, "way": way, "rmse_volt": rmse_volt}


def test_the_worst_cell_is_that_of_which_the_correction_errs_most():
    """D's test is followed by no model; of B the correction loses most, over both its tests."""
    rows = [row("A", "bias", 3e-3), row("A", "own", 2e-3)]
    rows += [row("B", "bias", 3e-3), row("B", "bias", 5e-3), row("B", "own", 2e-3)]
    rows += [row("D", "bias", 9e-3), row("D", "own", 9e-3), row("C", "reference", 1.0)]
    found = worst_corrected(rows)
    assert (found["cell"], found["rmse_volt"]) == ("B", pytest.approx(np.sqrt(17e-6)))
    assert found["own_rmse_volt"] == 2e-3
    assert "D has the largest error, 9 mV, but its own model errs by 9 mV" in found["words"]
    with pytest.raises(Refusal, match="no cell has a corrected model that was scored"):
        worst_corrected([row("C", "reference", 1.0)])


def test_the_corrected_voltage_of_a_cell_is_what_its_row_was_scored_by(compared):
    rows = compared.rows
    all_cells = cells(8)
    tests = all_cells[2].tests
    voltages = corrected_voltages(all_cells, "C2", tests, split_rest_second=60.0)
    error = tests[0].series["voltage_volt"] - voltages["drive"][1]
    (scored_row,) = [r for r in rows if (r["cell"], r["way"]) == ("C2", "bias")]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(scored_row["rmse_volt"], rel=1e-9)
    with pytest.raises(Refusal, match="no cell X; there are C0, C1"):
        corrected_voltages(all_cells, "X", tests, split_rest_second=60.0)
