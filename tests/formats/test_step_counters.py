"""Bitrode's counter, which starts again with most steps: charge where samples are too far apart."""

import numpy as np
import pytest

from cellwright import formats
from cellwright.formats.bitrode import COLUMNS
from cellwright.series.cleaning import clean

PULSES = 40
LOAD_AMPERE, PULSE_AMPERE = -10.0, -60.0


def pulsed_text(*, rest_keeps_counter):
    """A discharge with 15 ms pulses between samples 5 s apart, as an export of the instrument."""
    rows, time, step, charge = [], 5.0, 1, 0.0
    for _ in range(PULSES):
        counter = 0.0
        for second in (5.0, 5.0, 4.985):
            counter += LOAD_AMPERE * second / 3600
            time += second
            rows.append((time, step, LOAD_AMPERE, counter, "DCHG"))
        charge += counter
        pulse = PULSE_AMPERE * 0.015 / 3600
        charge, time = charge + pulse, time + 0.015
        rows.append((time, step + 1, PULSE_AMPERE, pulse, "DCHG"))
        step += 2
    rows.append((time + 5, step, 0.0, pulse if rest_keeps_counter else 0.0, "REST"))
    first = (5.0, 0, 0.0, 0.0, "REST")
    lines = [
        f"No,{t:.3f},1,1,1,1,{s},0.0,{i:.3f},{3.7 + i / 1000:.4f},0.0,{q:.4f},0.0,{mode}, "
        for t, s, i, q, mode in [first, *rows]
    ]
    return "\n".join([COLUMNS, *lines]).encode() + b"\n", charge


@pytest.mark.parametrize("rest_keeps_counter", [True, False])
def test_pulses_between_samples_are_counted_by_the_counter(rest_keeps_counter):
    text, true = pulsed_text(rest_keeps_counter=rest_keeps_counter)
    columns = formats.read(text, name="some.csv").columns
    assert columns["net_capacity_ampere_hour"][-1] == pytest.approx(true, rel=3e-3)
    counted = clean(columns).columns["charge_ampere_hour"][-1]
    assert counted == pytest.approx(true, rel=3e-3)
    time, current = columns["test_time_second"], columns["current_ampere"]
    guessed = np.trapezoid(current, time) / 3600
    assert guessed / true > 1.5  # what samples alone make of it


def test_measured_counter(shared):
    """LEAF: each portion is 1080.1 s at 10 A; the first row of the rest behind it is 60 s late."""
    file = shared / "campaigns/leaf/raw/hppc/NissanLeaf-cell-Low-Current-HPPC-25C-2.csv.gz"
    columns = formats.read(file.read_bytes(), name=file.name).columns
    charge = clean(columns).columns["charge_ampere_hour"]
    bounds = np.flatnonzero(np.diff((columns["step_index"] == 9).astype(int)))
    begins, ends = bounds[:18:2], bounds[1:18:2] + 1
    assert charge[ends] - charge[begins] == pytest.approx(-10 * 1080.1 / 3600, abs=0.015)
