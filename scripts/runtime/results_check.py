"""Run tests/artefacts on the results of a run, and list the outcome of each test."""

import contextlib
import io
from pathlib import Path

TESTS = Path(__file__).resolve().parents[2] / "tests" / "artefacts"


class _Collector:
    """A pytest plugin that keeps each test's outcome and its first line of documentation."""

    def __init__(self):
        self.rows = []
        self.documented = {}

    def pytest_collection_modifyitems(self, items):
        self.documented = {item.nodeid: (item.function.__doc__ or item.name) for item in items}

    def pytest_runtest_logreport(self, report):
        if report.when == "call" or report.outcome != "passed":
            lines = [x for x in report.longreprtext.splitlines() if x.startswith("E ")]
            message = lines[0].removeprefix("E ").strip() if report.failed and lines else ""
            law = self.documented[report.nodeid].strip().splitlines()[0]
            self.rows.append({"check": law, "outcome": report.outcome, "found": message})


def outcomes(folder) -> list[dict]:
    """Rows check, outcome (passed, failed, skipped), found; in the order of the file.

    Parameters
    ----------
    folder : where the tables of the run lie.
    """
    import pytest

    collector = _Collector()
    # The settings of the folder in which a run is started do not count, and no cache is left in it.
    settings = ["-q", "-p", "no:cacheprovider", "--rootdir", str(TESTS), "-c", "/dev/null"]
    with contextlib.redirect_stdout(io.StringIO()):
        ended = pytest.main(
            [*settings, "--import-mode=importlib", "--results", str(folder), str(TESTS)],
            plugins=[collector],
        )
    # No tests found, or an error in them, must not read like results that passed.
    if ended not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise RuntimeError(f"the checks themselves could not run: pytest ended with {ended}")
    return collector.rows
