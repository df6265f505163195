"""Files spoiled as a whole are refused by the pipeline's readers, each with its reason."""

from functools import partial

import pytest

from cellwright import formats
from cellwright.refusal import Refusal
from virtual_lab import file_faults, instruments, measurement

SERIES = sorted(name for name in instruments.WRITERS if not name.endswith("eis"))
FILE_FAULTS = {
    file_faults.cut_off: "cut off|damaged",
    file_faults.emptied: "the file is empty",
    partial(file_faults.damaged, seed=1): "damaged|cut off",
    partial(file_faults.torn_row, seed=1): "line [0-9]+: .*cut off|time",
}


@pytest.fixture
def shown(ideal):
    return measurement.measured(ideal, seed=5)


@pytest.mark.parametrize("name", SERIES)
@pytest.mark.parametrize("fault", FILE_FAULTS)
def test_a_spoiled_file_is_refused_with_its_reason(shown, name, fault):
    if name == "parquet" and "torn" in str(fault):
        pytest.skip("Parquet has no rows of text")
    left, done = fault(instruments.WRITERS[name](shown))
    assert done
    with pytest.raises(Refusal, match=FILE_FAULTS[fault]):
        formats.read(left, name="file")


def test_a_torn_row_is_named_by_its_line(shown):
    left, done = file_faults.torn_row(instruments.bdf_csv(shown), seed=2)
    with pytest.raises(Refusal, match=f"line {done[0]['value']}:"):
        formats.read(left, name="file")


@pytest.mark.parametrize(("name", "lines"), [("arbin", 1), ("bdf", 1), ("digatron", 30)])
def test_a_header_without_rows_is_refused(shown, name, lines):
    left, _ = file_faults.header_only(instruments.WRITERS[name](shown), lines=lines)
    with pytest.raises(Refusal, match="no row"):
        formats.read(left, name="file")


def test_spoiling_is_the_same_each_time(shown):
    content = instruments.bdf_csv(shown)
    for fault in FILE_FAULTS:
        assert fault(content) == fault(content)
