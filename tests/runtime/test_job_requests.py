"""Memory, time and group of jobs from the table of measured costs; the tool that measures them."""

import pytest

from runtime import job_requests

HEAD = "rule,part,jobs,cpu_second,longest_cpu_second,peak_megabyte\n"


def table(folder, *lines):
    path = folder / "costs.csv"
    path.write_text(HEAD + "".join(f"{line}\n" for line in lines), encoding="utf-8")
    return path


def test_a_job_asks_for_more_than_was_measured_and_twice_as_much_at_each_attempt(tmp_path):
    cost = job_requests.read(table(tmp_path, "identify,models,5,60.0,41.0,210"))["identify"]
    asked = job_requests.requests(cost)
    assert [asked["mem_mb"](None, attempt) for attempt in (1, 2, 3)] == [500, 1000, 2000]
    assert [asked["runtime"](None, attempt) for attempt in (1, 2)] == [7, 14]


@pytest.mark.parametrize(
    ("part", "wildcards", "group"),
    [
        ("tests", {"cell", "test"}, "tests_{cell}"),
        ("packs", {"group", "test"}, "packs_{group}"),
        ("figures", {"owner"}, "figures_{owner}"),
        ("", {"table"}, None),
    ],
)
def test_a_group_is_of_one_part_of_one_cell_or_group(part, wildcards, group):
    assert job_requests.group_of(job_requests.Cost(part, 0.5, 1.0, 100.0), wildcards) == group
