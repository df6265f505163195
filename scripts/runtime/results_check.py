"""Run tests/artefacts on the results of a run: what holds, and of which cell and test it does not.

A law notes a sentence on each row where it does not hold, so that people read what is wrong with a
cell and a test, and not how a program said so.
"""

import contextlib
import io
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[2] / "tests" / "artefacts"
# No plugins of other packages, which take a second to load, nor those that end each run with rounds
# of garbage collection: a job holds hundreds of thousands of objects.
QUICK = ("--disable-plugin-autoload", "-p", "no:unraisableexception", "-p", "no:threadexception")
MOST_ROWS = 3  # of one cell and test that a law names; it counts the others


class Broken(AssertionError):
    """Where a law does not hold: `found` has rows cell, test, found (a sentence)."""

    def __init__(self, found):
        super().__init__("; ".join(f"{r['cell']} {r['test']}: {r['found']}" for r in found))
        self.found = found


class Law:
    """What one law finds: `add` for each row where it does not hold, then `hold`."""

    def __init__(self):
        self.sentences = {}

    def add(self, row, sentence):
        """Note that the law does not hold for a row of a cell or group, and test."""
        whose = (row.get("cell") or row.get("group") or "", row.get("test") or "")
        self.sentences.setdefault(whose, []).append(sentence)

    def each(self, rows, wrong, sentence):
        """Note each row of which `wrong` (function of a row) is true; `sentence` is a template.

        A row that cannot be asked, for it holds a text where a number belongs, is noted as such
        and keeps no other from being asked.
        """
        for row in rows:
            try:
                if wrong(row):
                    self.add(row, sentence.format(**row))
            except (TypeError, ValueError, KeyError) as error:
                self.add(row, f"a row cannot be checked: {error}")

    def hold(self):
        """Raise Broken where anything was noted."""
        found = [
            {"cell": cell, "test": test, "found": _in_words(sentences)}
            for (cell, test), sentences in sorted(self.sentences.items())
        ]
        if found:
            raise Broken(found)


def _in_words(sentences):
    """The first few of some sentences, and how many more there are."""
    more = len(sentences) - MOST_ROWS
    shown = "; ".join(sentences[:MOST_ROWS])
    return f"{shown}; and {more} more" if more > 0 else shown


def _of_error(error) -> list[dict]:
    """What a law found that ended with this error."""
    if isinstance(error, Broken):
        return error.found
    first = (str(error).splitlines() or [""])[0]
    if isinstance(error, AssertionError):
        said = f"does not hold: {first.removeprefix('assert ')}".removesuffix(": ")
    else:
        said = f"could not be checked ({type(error).__name__}: {first})".replace(": )", ")")
    return [{"cell": "", "test": "", "found": said}]


class _Collector:
    """A pytest plugin that keeps each test's outcome and its first line of documentation."""

    def __init__(self):
        self.rows = []
        self.documented = {}

    def pytest_collection_modifyitems(self, items):
        self.documented = {item.nodeid: (item.function.__doc__ or item.name) for item in items}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, call):
        report = yield
        if report.when == "call" or report.outcome != "passed":
            law = self.documented[report.nodeid].strip().splitlines()[0]
            found = _of_error(call.excinfo.value) if report.failed else [{}]
            blank = {"cell": "", "test": "", "found": ""}
            self.rows += [{"check": law, "outcome": report.outcome} | blank | row for row in found]
        return report


def outcomes(folder) -> list[dict]:
    """Rows check, outcome (passed, failed, skipped), cell, test, found; in the order of the file.

    A law that holds, or has no table, is one row; one that is broken one a cell and test.

    Parameters
    ----------
    folder : where the tables of the run lie.
    """
    collector = _Collector()
    # The settings of the folder in which a run is started do not count, and no cache is left in it.
    settings = ["-q", "-p", "no:cacheprovider", "--rootdir", str(TESTS), "-c", "/dev/null"]
    settings += QUICK
    with contextlib.redirect_stdout(io.StringIO()):
        ended = pytest.main(
            [*settings, "--import-mode=importlib", "--results", str(folder), str(TESTS)],
            plugins=[collector],
        )
    # No tests found, or an error in them, must not read like results that passed.
    if ended not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise RuntimeError(f"the checks themselves could not run: pytest ended with {ended}")
    return collector.rows
