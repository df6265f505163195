"""Raw files: each way in which a file is not the one that was meant."""

import hashlib

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


def test_a_large_file_that_grows_while_it_is_read_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(gate, "LARGE", 2)
    ((_, opened),) = raw_files.contents(["good.csv"], None)
    with (tmp_path / "good.csv").open("ab") as file:
        file.write(b"3,4\n")
    with pytest.raises(Refusal, match=r"good.csv: the file was written to while it was read"):
        opened.read(100)
