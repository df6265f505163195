"""Raw files: each way in which a file is not the one that was meant."""

import hashlib
import os

import pytest

from cellwright import gate
from cellwright.refusal import Refusal
from runtime import raw_files


@pytest.fixture(autouse=True)
def campaign(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.csv").write_bytes(b"1,2\n")
    (tmp_path / "empty.csv").write_bytes(b"")
    (tmp_path / "folder.csv").mkdir()


def test_bytes_come_in_the_order_of_the_sheet():
    sums = [hashlib.sha256(b"1,2\n").hexdigest().upper()]
    assert raw_files.contents(["good.csv"], sums) == [("good.csv", b"1,2\n")]
    assert raw_files.contents(["good.csv"], None) == [("good.csv", b"1,2\n")]


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("missing.csv", "missing.csv: there is no such file"),
        ("folder.csv", "folder.csv: is a folder, wanted a file"),
        ("empty.csv", r"empty.csv: the file is empty \(0 bytes\)"),
    ],
)
def test_what_is_no_file_is_refused(file, said):
    with pytest.raises(Refusal, match=said):
        raw_files.contents([file], None)


def test_another_file_than_the_sheet_says_is_refused():
    with pytest.raises(Refusal, match=r"good.csv: SHA-256 is .*, tests.tsv says 00"):
        raw_files.contents(["good.csv"], ["00"])


def test_a_test_without_files_is_refused():
    with pytest.raises(Refusal, match="names no file"):
        raw_files.contents([], None)


def test_a_spectrum_is_one_file():
    assert raw_files.single(["good.csv"], None)[1] == b"1,2\n"
    with pytest.raises(Refusal, match=r"2 files are joined \(good.csv;good.csv\)"):
        raw_files.single(["good.csv", "good.csv"], None)


def test_a_large_file_is_handed_open_and_held_against_its_checksum(monkeypatch):
    monkeypatch.setattr(gate, "LARGE", 2)
    ((name, opened),) = raw_files.contents(["good.csv"], [hashlib.sha256(b"1,2\n").hexdigest()])
    assert (name, opened.read()) == ("good.csv", b"1,2\n")
    with pytest.raises(Refusal, match=r"good.csv: SHA-256 is .*, tests.tsv says 00"):
        raw_files.contents(["good.csv"], ["00"])


def test_a_large_file_that_grows_while_it_is_read_fails_its_job(monkeypatch, tmp_path):
    monkeypatch.setattr(gate, "LARGE", 2)
    ((_, opened),) = raw_files.contents(["good.csv"], None)
    grow(tmp_path)
    with pytest.raises(raw_files.Changed, match=r"good.csv: the file was written to while it was"):
        opened.read(100)


def grow(folder):
    with (folder / "good.csv").open("ab") as file:
        file.write(b"3,4\n")


@pytest.mark.parametrize("large", [2, gate.LARGE])
def test_of_a_file_that_has_grown_what_was_planned_with_is_read(monkeypatch, tmp_path, large):
    monkeypatch.setattr(gate, "LARGE", large)
    content = raw_files.planned({"good.csv": None})
    grow(tmp_path)
    ((_, data),) = raw_files.contents(["good.csv"], None, content=content)
    assert (data if isinstance(data, bytes) else data.read(100)) == b"1,2\n"
    # Written to once more while it is read: behind what was planned with nothing is read.
    ((_, data),) = raw_files.contents(["good.csv"], None, content=content)
    grow(tmp_path)
    assert (data if isinstance(data, bytes) else data.read(100)) == b"1,2\n"


@pytest.mark.parametrize("large", [2, gate.LARGE])
@pytest.mark.parametrize("other", [b"1,3\n", b"1,3\n4,5\n", b"1", None])
def test_a_file_replaced_since_the_plan_fails_its_job(monkeypatch, tmp_path, large, other):
    """Which then is made again: a refusal would leave the test out for good."""
    monkeypatch.setattr(gate, "LARGE", large)
    content = raw_files.planned({"good.csv": None})
    (tmp_path / "good.csv").unlink()
    if other is not None:
        (tmp_path / "good.csv").write_bytes(other)
    with pytest.raises(OSError, match=r"good.csv.*when th(e|is) run was planned"):
        raw_files.contents(["good.csv"], None, content=content)


def test_a_copy_with_an_older_date_is_another_content_and_a_touched_file_is_not(tmp_path):
    path = tmp_path / "good.csv"
    before = raw_files.planned({"good.csv": None, "empty.csv": None})
    path.touch()
    assert raw_files.planned({"good.csv": None, "empty.csv": None}) == before
    about = path.stat()
    path.write_bytes(b"1,3\n")  # of the same length, and then with the very date of the first one
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))
    after = raw_files.planned({"good.csv": None, "empty.csv": None})
    assert after["good.csv"] == [hashlib.sha256(b"1,3\n").hexdigest(), 4]
    assert raw_files.changed(before, after) == ["good.csv"]
    os.utime(path, (1e9, 1e9))
    assert raw_files.planned({"good.csv": None, "empty.csv": None}) == after


def test_what_the_gate_does_not_open_is_no_input():
    files = dict.fromkeys(["good.csv", "folder.csv", "missing.csv", "../a.csv"])
    assert list(raw_files.planned(files)) == ["good.csv"]
    assert raw_files.planned({"good.csv": 1e-9}) == {}


def test_a_file_that_was_not_touched_is_read_once(monkeypatch):
    """And one that was written to just now each time: its clock may be too coarse to tell."""
    reads = []
    digest = hashlib.file_digest
    monkeypatch.setattr(hashlib, "file_digest", lambda *a: reads.append(a) or digest(*a))
    found = [raw_files.planned({"good.csv": None}) for _ in range(2)]
    assert len(reads) == 2
    now = raw_files.time.time_ns()
    monkeypatch.setattr(raw_files.time, "time_ns", lambda: now + 60 * 10**9)
    found += [raw_files.planned({"good.csv": None}) for _ in range(3)]
    assert len(reads) == 3
    assert all(one == found[0] for one in found)
