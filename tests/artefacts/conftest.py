"""Results under test: the tables of a finished run, given as `--results` by rule `checks`."""

import csv
from pathlib import Path

import pytest

from runtime.csv_cells import as_written
from runtime.results_check import Law


class Tables:
    """Rows of the results' tables by name, numbers as numbers, empty cells as None."""

    def __init__(self, folder: Path):
        self.folder = folder

    def __call__(self, name: str) -> list[dict]:
        path = self.folder / f"{name}.csv"
        if not path.is_file():
            pytest.skip(f"{path} is not there")
        with open(path, encoding="utf-8", newline="") as file:
            return [
                {key: _value(text) for key, text in row.items()} for row in csv.DictReader(file)
            ]


def _value(text):
    if text in ("", "True", "False"):
        return {"": None, "True": True, "False": False}[text]
    try:
        return float(text)
    except ValueError:
        return as_written(text)


def pytest_addoption(parser):
    """Where the results lie; without it these tests are skipped."""
    parser.addoption("--results", default=None, help="folder with the tables of a finished run")


@pytest.fixture
def table(request) -> Tables:
    """Reader of one table of the run under test."""
    folder = request.config.getoption("--results", default=None)
    if folder is None:
        pytest.skip("tests of results run inside the workflow (rule checks)")
    return Tables(Path(folder))


@pytest.fixture
def law() -> Law:
    """What the law under test finds, by cell and test."""
    return Law()
