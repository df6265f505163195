"""What the public interface takes: columns in each form, settings in each form, what it refuses."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import polars
import pytest

import cellwright as cw
from cellwright import result as results
from cellwright.records import inputs
from runtime import settings

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


def record(hours=3.0, second=10.0):
    """A rest, a discharge and a charge at 1C of 2 Ah, and a rest, with an ohmic drop."""
    time = np.arange(0.0, 3600 * hours, second)
    ampere = np.select([(time >= 600) & (time < 4000), (time >= 5000) & (time < 8400)], [-2.0, 2.0])
    soc = 1.0 + np.concatenate([[0.0], np.cumsum(ampere[:-1] * second)]) / 7200
    columns = {"test_time_second": time, "current_ampere": ampere}
    return columns | {"voltage_volt": 3.2 + 0.9 * soc + 0.02 * ampere}


CELL = cw.CellFacts("A", 2.0, 3.22, 4.12)


def test_a_frame_a_mapping_and_a_result_give_the_same():
    columns = record()
    by_mapping, by_frame = cw.clean(columns), cw.clean(pd.DataFrame(columns))
    pd.testing.assert_frame_equal(by_mapping.to_frame(), by_frame.to_frame())
    steps = [cw.segment(one, CELL).to_frame() for one in (by_mapping, by_frame.to_frame())]
    pd.testing.assert_frame_equal(*steps)
    assert list(steps[0]["kind"]) == ["rest", "CC", "rest", "CC", "rest"]


def test_steps_are_taken_as_result_or_as_table():
    series = cw.clean(record())
    steps = cw.segment(series, CELL)
    steps_with_more = steps.to_frame().assign(note="of no use here")
    mapping = {"cell": "A", "rated_capacity_ampere_hour": 2.0, "note": "of no use here"}
    mapping |= {"lower_cutoff_volt": 3.22, "upper_cutoff_volt": 4.12}
    found = [
        cw.capacity(series, one, cell, whole_swing=True).to_frame()
        for one, cell in ((steps, CELL), (steps_with_more, mapping))
    ]
    pd.testing.assert_frame_equal(*found)
    assert found[0]["capacity_ampere_hour"].to_numpy() == pytest.approx(3400 / 1800, rel=0.01)


def test_a_missing_column_is_named():
    with pytest.raises(cw.Refusal, match="no column voltage_volt; there are test_time_second"):
        cw.clean({"test_time_second": [0.0, 1.0], "current_ampere": [0.0, 0.0]})
    with pytest.raises(cw.Refusal, match="charge_ampere_hour; `clean` makes it"):
        cw.segment(record(), CELL)


OWN = {
    "test_time_second": "Time [s]",
    "current_ampere": "Current [A]",
    "voltage_volt": "Voltage [V]",
}


def test_a_table_with_labels_of_its_own_is_read_as_its_csv(tmp_path):
    own = pd.DataFrame(record()).rename(columns=OWN)
    own.to_csv(tmp_path / "own.csv", index=False)
    by_csv = cw.clean(cw.read(tmp_path / "own.csv"))
    for table in (own, dict(own), own.set_index("Time [s]"), polars.from_pandas(own)):
        for found in (cw.clean(table), cw.clean(cw.read(table))):
            pd.testing.assert_frame_equal(found.to_frame(), by_csv.to_frame())
    milli = own.assign(**{"Current (mA)": 1e3 * own["Current [A]"]}).drop(columns="Current [A]")
    ampere = cw.clean(milli).to_frame()["current_ampere"]
    np.testing.assert_allclose(ampere, record()["current_ampere"], rtol=1e-12)


def test_labels_that_nobody_knows_are_named():
    own = pd.DataFrame(record()).set_axis(["x", "Wert", "Anzeige"], axis=1)
    with pytest.raises(cw.Refusal, match=r"the table: .*'x', 'Wert', 'Anzeige'"):
        cw.clean(own)
    two = {"Time [s]": [0.0, 1.0], "Current [A]": [0.0, 1.0]}
    with pytest.raises(cw.Refusal, match=r"no column test_time_.*there are Time \[s\], Current"):
        cw.clean(two)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda x: x.astype(str), "row 1: found '0.0', a text; wanted a number"),
        (lambda x: x.astype(object).where(x.index != 7, "n/a"), "row 8: found 'n/a', a text"),
        (lambda x: pd.Timestamp("2024-05-01") + pd.to_timedelta(x, unit="h"), "2024-05-01.*a date"),
        (lambda x: pd.to_timedelta(x, unit="h"), r"a duration; .*total_seconds\(\)"),
        (lambda x: x > 0, "found False, true or false"),
        (lambda x: x + 1j, "a complex number"),
    ],
)
@pytest.mark.parametrize(
    "name", ["test_time_second", "current_ampere", "surface_temperature_celsius"]
)
def test_what_is_no_number_is_refused_by_its_column(name, change, said):
    frame = pd.DataFrame(record()).assign(surface_temperature_celsius=0.0)
    with pytest.raises(cw.Refusal, match=f"column {name}, .*{said}"):
        cw.clean(frame.assign(**{name: change(frame["current_ampere"])}))


def test_blanks_of_a_table_are_no_numbers_and_no_texts():
    """None and pandas' NA are read as a blank cell of a csv is."""
    frame = pd.DataFrame(record())
    gone = frame.assign(voltage_volt=frame["voltage_volt"].where(frame.index != 9))
    other = gone.assign(
        voltage_volt=gone["voltage_volt"].astype(object).where(gone.index != 9, None)
    )
    nullable = gone.assign(voltage_volt=gone["voltage_volt"].astype("Float64"))
    wanted = cw.clean(gone).to_frame()
    for table in (other, nullable):
        pd.testing.assert_frame_equal(cw.clean(table).to_frame(), wanted)


def test_a_column_of_rows_and_columns_is_refused():
    with pytest.raises(cw.Refusal, match="test_time_second: found 2 dimensions"):
        cw.clean({name: np.zeros((5, 2)) for name in record()})


def test_a_mistyped_fact_is_refused_as_a_setting_is():
    series = cw.clean(record())
    cell = {"cell": "A", "rated_capacity": 2.0}
    with pytest.raises(cw.Refusal, match="no rated_capacity; did you mean rated_capacity_ampere_h"):
        cw.segment(series, cell)
    with pytest.raises(cw.Refusal, match="rated_capacity_ampere_hour: found '2', wanted a number"):
        cw.segment(series, {"cell": "A", "rated_capacity_ampere_hour": "2"})
    with pytest.raises(cw.Refusal, match="TestFacts has no temperature"):
        inputs.test_facts({"test": "x", "kind": "ocv", "temperature": 25.0})


@pytest.mark.parametrize(
    ("kind", "sheet"),
    [(cw.CellFacts, "cells"), (cw.TestFacts, "tests"), (inputs.BranchFacts, "groups")],
)
def test_a_row_of_a_sheet_is_facts_as_it_stands(kind, sheet):
    known = {*kind._fields, *inputs.FURTHER[kind]}
    columns = set(settings.load(SCRIPTS.parent / "workflow/schemas", sheet)["properties"])
    assert columns <= known
    assert known - columns <= {"initial_soc"}, "of simulations alone"


def test_columns_of_different_lengths_are_refused():
    with pytest.raises(cw.Refusal, match="different lengths"):
        cw.clean(record() | {"voltage_volt": [3.0]})


def test_what_is_no_table_is_refused():
    with pytest.raises(cw.Refusal, match="int is no DataFrame"):
        cw.clean(3)


def test_settings_in_each_form_do_the_same():
    whole = cw.settings.Segment(pulse_max_second=10.0)
    series = cw.clean(record())
    forms = [
        cw.segment(series, CELL, whole),
        cw.segment(series, CELL, whole._asdict()),
        cw.segment(series, CELL, pulse_max_second=10.0),
    ]
    first, *others = [one.to_frame() for one in forms]
    for other in others:
        pd.testing.assert_frame_equal(first, other)


def test_a_setting_reaches_the_step():
    series = cw.clean(record())
    kinds = cw.segment(series, CELL, pulse_max_second=5000.0).to_frame()["kind"]
    assert "pulse" in set(kinds)


def test_an_unknown_setting_is_refused_with_the_known_ones():
    with pytest.raises(cw.Refusal, match=r"no setting gap; it has .*gap_second"):
        cw.clean(record(), gap=3.0)


def test_settings_of_a_campaign_must_be_complete():
    """A key that a rule forgot must not be replaced by its default unseen."""
    with pytest.raises(cw.Refusal, match="settings Clean lack spike_limit_volt"):
        cw.clean(record(), {"gap_second": 3.0})


def test_facts_without_what_is_needed_are_refused():
    with pytest.raises(cw.Refusal, match="TestFacts needs kind"):
        inputs.test_facts({"test": "x"})


def test_a_file_that_is_not_there_is_refused():
    with pytest.raises(cw.Refusal, match=r"nowhere\.csv: there is no such file"):
        cw.read("nowhere.csv")


def test_facts_of_one_value_are_repeated_in_a_frame():
    frame = results.frame({"a": np.arange(3), "b": 2.0, "pair": (1, 2)})
    assert list(frame["b"]) == [2.0] * 3
    assert "pair" not in frame


def test_every_public_name_is_there():
    for name in cw.MODULE_OF:
        assert getattr(cw, name)
    with pytest.raises(AttributeError, match=r"has no .identfy.; did you mean identify\?"):
        cw.identfy  # noqa: B018


@pytest.mark.parametrize(
    ("code", "banned"),
    [
        ("import cellwright", ("numpy", "pandas", "scipy")),
        ("import cellwright as cw; cw.clean", ("pandas", "scipy")),
        (
            "import cellwright as cw; cw.capacity; import cellwright.protocols.capacity",
            ("pandas", "scipy", "matplotlib", "lmfit"),
        ),
    ],
)
def test_what_is_not_used_is_not_loaded(code, banned):
    check = f"import sys; sys.path.insert(0, {str(SCRIPTS)!r}); {code}; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", check], capture_output=True, text=True, check=True
    )
    assert not set(banned) & set(loaded.stdout.split())


def test_facts_of_another_kind_are_refused():
    with pytest.raises(cw.Refusal, match="found a TestFacts, wanted CellFacts or a mapping"):
        inputs.cell_facts(cw.TestFacts("t", "hppc"))
