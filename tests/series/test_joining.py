"""Several files of one test become one series: clock, counter, order."""

import numpy as np
import pandas as pd
import pytest

from cellwright import formats
from cellwright.refusal import Refusal
from cellwright.series import assemble
from cellwright.series.doubts import Doubt
from cellwright.series.joining import join


def part(start=0.0, rows=11, *, unix=None, counter=None):
    columns = {
        "test_time_second": start + np.arange(rows, dtype=float),
        "current_ampere": np.ones(rows),
        "voltage_volt": np.full(rows, 3.7),
    }
    if unix is not None:
        columns["unix_time_second"] = unix + np.arange(rows, dtype=float)
    if counter is not None:
        columns["net_capacity_ampere_hour"] = counter + np.arange(rows) / 3600
    return columns


def test_dates_give_the_real_pause():
    joined = join([part(unix=1e9), part(unix=1e9 + 3610)])
    assert joined.columns["test_time_second"][11] == pytest.approx(3610)
    assert "begins 3600 s after the end of file 1, by their dates" in joined.notes[0]
    assert joined.columns["file_index"].tolist() == [0] * 11 + [1] * 11


def test_a_clock_that_goes_on_is_kept():
    joined = join([part(), part(50.0)])
    assert joined.columns["test_time_second"][11] == 50
    assert "goes on" in joined.notes[0]


def test_a_clock_that_starts_anew_is_put_behind():
    joined = join([part(), part(), part(1.0)])
    assert np.diff(joined.columns["test_time_second"]).tolist() == [1.0] * 32
    assert "pause not known" in joined.notes[1]


def test_files_out_of_order_are_refused():
    with pytest.raises(Refusal, match="file 2 begins 110 s before file 1 ends"):
        join([part(unix=1e9), part(unix=1e9 - 100)])


@pytest.mark.parametrize(
    ("ends", "said", "pause"),
    [
        ("2025-10-26T02:50:00", "the clock being set back by an hour", 3200.0),
        ("2025-11-02T01:50:00", "the clock being set back by an hour", 3200.0),
        ("2025-10-27T02:50:00", "two clocks wrote them", 1.0),
        ("2025-10-26T12:50:00", "two clocks wrote them", 1.0),
        ("2025-07-06T02:50:00", "two clocks wrote them", 1.0),
    ],
)
def test_dates_that_go_back_by_less_than_an_hour(ends, said, pause):
    end = np.datetime64(ends).astype("datetime64[s]").astype(float)
    joined = join([part(rows=1001, unix=end - 1000), part(unix=end - 400)])
    assert said in joined.notes[0]
    assert np.diff(joined.columns["test_time_second"])[1000] == pytest.approx(pause)


@pytest.mark.parametrize("second", [0.0, 10 / 3600])
def test_counter_goes_on_over_files(second):
    joined = join([part(counter=0.0), part(counter=second)]).columns["net_capacity_ampere_hour"]
    assert np.diff(joined) == pytest.approx([1 / 3600] * 10 + [0] + [1 / 3600] * 10)


def test_counter_goes_on_over_a_reset_within_the_file():
    columns = part(rows=3601, counter=0.0)
    columns["net_capacity_ampere_hour"][1800:] -= columns["net_capacity_ampere_hour"][1800]
    joined = join([columns]).columns["net_capacity_ampere_hour"]
    assert joined[-1] == pytest.approx(1.0, abs=1e-3)


def test_a_column_of_one_file_is_nan_in_the_other():
    columns = join(
        [part(), {**part(20.0), "surface_temperature_celsius": np.full(11, 25.0)}]
    ).columns
    assert np.isnan(columns["surface_temperature_celsius"][:11]).all()
    assert (columns["surface_temperature_celsius"][11:] == 25).all()


def test_a_spectrum_is_no_series():
    with pytest.raises(Refusal, match="file 1 holds impedance, a series is wanted"):
        assemble([formats.Reading({}, "digatron", "impedance")])


def test_four_scripts_of_an_ocv_test(shared):
    folder = shared / "campaigns/a123/raw/ocv"
    names = [f"A123_OCV_P25_S{k}.csv.gz" for k in (1, 2, 3, 4)]
    columns, notes = assemble(
        [formats.read((folder / name).read_bytes(), name=name) for name in names]
    )
    counter = columns["net_capacity_ampere_hour"]
    assert counter.min() == pytest.approx(-2.0726, rel=0.002)  # published, his efficiency aside
    assert abs(counter[-1] - counter[0]) < 0.01, "full at the start and at the end"
    assert np.diff(columns["test_time_second"]).min() > 0
    assert any(note.startswith("file 2 begins 154150 s after the end of file 1") for note in notes)


@pytest.mark.parametrize(("gain", "sign"), [(1.0, 1), (1.0, -1), (1.05, 1), (0.9, -1)])
def test_the_energy_of_the_instrument_tells_a_wrong_voltage(gain, sign):
    time = np.arange(0, 7200, 10.0)
    current = np.where(time < 3600, -1.0, 1.0)
    voltage = 3.7 + 0.3 * current + 0.1 * np.sin(time / 1000)
    moved = current * voltage * 10 / 3600
    columns = {"Test Time / s": time, "Current / A": sign * current, "Voltage / V": gain * voltage}
    columns |= {"Charging Energy / Wh": np.cumsum(np.maximum(moved, 0))}
    columns |= {"Discharging Energy / Wh": np.cumsum(np.maximum(-moved, 0))}
    text = pd.DataFrame(columns).to_csv(index=False).encode()
    found = assemble([formats.read(text, name="file")]).columns
    assert "net_energy_watt_hour" not in found
    told = found.get("doubt", np.zeros(len(time), int))
    # Where charge and discharge meet in one stretch they may even out.
    assert not told.any() if gain == 1 else np.mean(told == Doubt.ENERGY) > 0.9
