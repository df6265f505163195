"""A stated SoC that the record's charge contradicts: said, what needs no SoC kept, no error."""

import numpy as np
import pytest

import cellwright as cw
from runtime import contract

CELL = cw.CellFacts("A", 2.0, 3.1, 4.2)
SIGNS = {"discharge": -1.0, "charge": 1.0}


def portions(direction):
    """Eight portions of 0.25 Ah of a cell of 2 Ah at C/2, each with a rest of 2000 s behind it."""
    one = [SIGNS[direction]] * 90 + [0.0] * 200
    current = np.array([0.0, *(one * 8)])
    time = 10.0 * np.arange(len(current))
    charge = np.concatenate([[0.0], np.cumsum((current[1:] + current[:-1]) / 720)])
    soc, lag, decay = (
        (0.95 if direction == "discharge" else 0.05) + charge / 2,
        [0.0],
        np.exp(-0.05),
    )
    for ampere in current[1:]:
        lag.append(decay * lag[-1] + 0.03 * (1 - decay) * ampere)
    noise = np.random.default_rng(0).normal(0.0, 1e-4, len(time))
    voltage = 3.2 + 0.9 * soc + 0.02 * current + np.array(lag) + noise
    return cw.clean({"test_time_second": time, "current_ampere": current, "voltage_volt": voltage})


def analysed(direction, soc):
    """Rows by stage, and all notes, of the analyses that label what they find by its SoC."""
    series = portions(direction)
    about = series, cw.segment(series, CELL), cw.basis(CELL)
    test = cw.TestFacts("r", "relaxation", 25.0, soc=soc)
    rests, pulses = cw.relaxation(*about, test, CELL), cw.resistance(*about, test, CELL)
    rows = {"relaxation": rests.rows, "resistance": pulses.rows}
    return rows, (rests.notes, pulses.notes)


@pytest.mark.parametrize(
    ("direction", "soc", "run"),
    [("discharge", 0.2, "-0.800 to 0.200"), ("charge", 0.8, "0.800 to 1.800")],
)
def test_what_needs_no_soc_is_kept_and_the_contradiction_is_said(direction, soc, run):
    rows, notes = analysed(direction, soc)
    right, _ = analysed(direction, 0.95 if direction == "discharge" else 0.05)
    for stage, columns in rows.items():
        contract.check(stage, columns)
        assert np.isnan(columns["soc"]).all()
        assert np.isfinite(right[stage]["soc"]).all()
    np.testing.assert_array_equal(rows["relaxation"]["ocv_volt"], right["relaxation"]["ocv_volt"])
    ohms = [found["resistance"]["resistance_ohm"] for found in (rows, right)]
    np.testing.assert_array_equal(*map(np.sort, ohms))
    for said in notes:
        (sentence,) = (note for note in said if note.startswith("SoC: not known"))
        assert f"runs from {run}, outside" in sentence
        assert "capacity of 2 Ah (rating) contradict each other" in sentence


@pytest.mark.parametrize(("direction", "soc"), [("discharge", 0.0), ("charge", 1.0)])
def test_what_the_first_rest_contradicts_is_said_and_the_record_tells(direction, soc):
    """It moves all of the capacity, so it tells by itself where it runs; its rests alone do not."""
    rows, notes = analysed(direction, soc)
    right, _ = analysed(direction, 1.0 - soc)
    for stage, columns in rows.items():
        np.testing.assert_allclose(columns["soc"], right[stage]["soc"], atol=1e-9)
    assert all(f"the stated SoC of {soc:g} is not used" in x for x in rows["resistance"]["doubt"])
    assert not any(right["resistance"]["doubt"])
    for said in notes:
        assert any(f"the stated SoC of {soc:g} is not used: a rest at" in note for note in said)
    series, test = portions(direction), cw.TestFacts("r", "hppc", 25.0, soc=soc)
    with pytest.raises(cw.Refusal, match=f"start: the stated SoC of {soc:g} is not used"):
        cw.ocv_from_rests(series, cw.segment(series, CELL), CELL, test)


def test_a_blank_lower_cutoff_is_a_refusal():
    series, test = portions("discharge"), cw.TestFacts("r", "hppc", 25.0, soc=1.0)
    blank = CELL._replace(lower_cutoff_volt=None)
    with pytest.raises(cw.Refusal, match="the lower cut-off is not stated"):
        cw.ocv_from_rests(series, cw.segment(series, CELL), blank, test)


@pytest.mark.parametrize(
    ("direction", "soc", "run"),
    [("discharge", 0.2, "-0.800 to 0.200"), ("charge", 0.8, "0.800 to 1.800")],
)
def test_an_ocv_from_rests_needs_the_soc_and_is_refused(direction, soc, run):
    series = portions(direction)
    steps = cw.segment(series, CELL)
    with pytest.raises(cw.Refusal, match=f"runs from {run}, .* contradict each other"):
        cw.ocv_from_rests(series, steps, CELL, cw.TestFacts("r", "relaxation", 25.0, soc=soc))
    unrated = CELL._replace(rated_capacity_ampere_hour=None)
    for cell in (CELL, unrated):
        with pytest.raises(cw.Refusal):
            cw.ocv_from_rests(series, steps, cell, cw.TestFacts("r", "hppc", 25.0, soc=soc))


def test_a_cell_stated_full_may_hold_more_than_its_rating():
    """Then the record itself tells the capacity: there is no contradiction of SoC and charge."""
    series, small = portions("discharge"), CELL._replace(rated_capacity_ampere_hour=1.7)
    test = cw.TestFacts("r", "hppc", 25.0, soc=1.0)
    found = cw.ocv_from_rests(series, cw.segment(series, CELL), small, test)
    assert found.curve.capacity_ampere_hour == pytest.approx(2.0, rel=0.01)
