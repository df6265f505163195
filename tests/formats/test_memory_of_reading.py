"""What reading and cleaning hold beside the columns of a record does not grow with its rows."""

import tracemalloc

import numpy as np
import pyarrow as pa
import pytest

import cellwright as cw
from cellwright.formats.dates import Clocks, Dates, Times
from cellwright.formats.table import Words

ROWS = 300_000
LABELS = "Data Point,Date Time,Test Time (s),Step Index,Current (A),Voltage (V)"
LABELS += ",Charge Capacity (Ah),Discharge Capacity (Ah),Charge Energy (Wh),Discharge Energy (Wh)"


def record():
    """An Arbin csv: cycles of an hour of charge, rest, discharge and rest."""
    second = np.arange(ROWS)
    step = (second // 3600) % 4
    ampere = np.array([2.5, 0.0, -2.5, 0.0])[step]
    counters = [np.cumsum(np.maximum(sign * ampere, 0)) / 3600 for sign in (1, -1)]
    volt = 3.2 + 0.3 * (counters[0] - counters[1]) + 0.012 * ampere
    energies = [np.cumsum(np.maximum(sign * ampere, 0) * volt) / 3600 for sign in (1, -1)]
    clock = 1_704_067_200 + second.astype("datetime64[s]").astype(int)
    stamps = np.char.replace(clock.astype("datetime64[s]").astype(str), "T", " ")
    columns = [second + 1, stamps, second, step + 1, ampere, np.round(volt, 6)]
    columns += [np.round(counted, 9) for counted in (*counters, *energies)]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return (LABELS + "\n" + "\n".join(",".join(map(str, row)) for row in rows)).encode()


def test_cleaning_takes_the_charge_and_little_more():
    """Eight bytes a row are the charge's own; before the pieces it was 92 in all."""
    series = cw.read(record())
    cw.clean(series)  # what is imported and kept by the way
    tracemalloc.start()
    cleaned = cw.clean(series)
    more = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(cleaned.columns["voltage_volt"]) == ROWS
    assert "doubt" not in cleaned.columns
    assert more < 48 * ROWS


@pytest.mark.parametrize(
    ("keeper", "text", "byte"),
    [
        (lambda: Dates(["%Y-%m-%d %H:%M:%S"]), "2024-02-29 23:59:{:02d}", 0),
        (Clocks, "1d 02:00:{:02d}.5", 0),
        (lambda: Times(["%d.%m.%Y %H:%M"]), "29.02.2024 12:{:02d}", 0),
        (Words, "constant current {:02d}", 5),
    ],
)
def test_a_column_of_texts_keeps_none_of_them(keeper, text, byte):
    """Of a million texts there are no more beside the numbers than of the piece that is read."""
    block = pa.array([text.format(k % 60) for k in range(1 << 14)])
    column, before, rows = keeper(), pa.total_allocated_bytes(), 0
    for _ in range(64):
        column.add(pa.array(block.to_pylist()))
        rows += len(block)
        assert pa.total_allocated_bytes() - before < byte * rows + 6 * block.nbytes
    assert column.all() is not None


def test_texts_of_pieces_are_those_of_the_column():
    """Words that come late, blank ones; dates without seconds, whose format a late one tells."""
    words, dates = Words(), Dates(["%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M"])
    days = [f"{1 + k % 12:02d}/{1 + k // 7000 % 12:02d}/2024 07:30" for k in range(200_000)]
    days[150_000] = "01/31/2024 07:30"
    letters = ["C"] * 100_000 + ["D", ""] * 49_999 + ["R", "C"]
    for first in range(0, len(days), 30_000):
        words.add(pa.array(letters[first : first + 30_000]))
        dates.add(pa.array(days[first : first + 30_000]))
    assert words.all().to_pylist() == letters
    assert words.all().dictionary.to_pylist() == ["C", "D", "", "R"]
    found = dates.all().seconds
    assert list(found) == ["%m/%d/%Y %H:%M"]
    wanted = np.array([f"{day[6:10]}-{day[:2]}-{day[3:5]}T07:30" for day in days], "datetime64[s]")
    assert np.array_equal(found["%m/%d/%Y %H:%M"], wanted.astype(float))
