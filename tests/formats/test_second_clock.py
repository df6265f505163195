"""Two columns of time in one file: the one that is read must not be contradicted by the other."""

import numpy as np
import pytest

import cellwright as cw

TIME = 10.0 * np.arange(100)


def read(first, second, values, others="Current (A),Voltage (V)"):
    """A series of 1 A, in whose file two columns of time stand."""
    current = np.where(np.arange(100) < 50, 1.0, -1.0)
    voltage = 3.7 + np.cumsum(current) / 1e3 + 0.05 * current
    rows = zip(TIME, values, current, voltage, strict=True)
    lines = [f"{first},{second},{others}", *(",".join(f"{x:.6g}" for x in row) for row in rows)]
    made = "\n".join(lines).encode()
    return cw.read(made, name="two.csv", current_sign="charge_positive").columns


LABELS = [
    ("Test Time / s", "Time / s", "Current / A,Voltage / V"),
    ("Test Time (s)", "Time (s)", "Current (A),Voltage (V)"),
    ("Time (s)", "Total Time (s)", "Current (A),Voltage (V)"),
]


@pytest.mark.parametrize(("first", "second", "others"), LABELS)
def test_a_clock_that_runs_by_a_tenth_faster_is_refused_with_both_names(first, second, others):
    with pytest.raises(cw.Refusal, match=r"contradict each other.* times as fast") as reason:
        read(first, second, 1.1 * TIME, others)
    assert repr(first) in str(reason.value)
    assert repr(second) in str(reason.value)


@pytest.mark.parametrize(("first", "second", "others"), LABELS)
@pytest.mark.parametrize("values", [TIME + 5000, TIME % 300, np.minimum(TIME, 400)])
def test_another_begin_or_a_clock_of_steps_or_of_a_load_is_none(first, second, others, values):
    assert len(read(first, second, values, others)["test_time_second"]) == 100


def test_the_same_time_in_another_unit_is_the_same():
    read("Test Time (s)", "Time (h)", TIME / 3600)
    with pytest.raises(cw.Refusal, match="'Time \\(h\\)' runs 60 times"):
        read("Test Time (s)", "Time (h)", TIME / 60)
