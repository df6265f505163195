"""What several test rooms share: measured campaigns, and a stand-in for a job's `snakemake`."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

# Small matrices: threads of the linear algebra only wait for each other, tens of times longer
# where the machine is shared. Heeded where numpy has not been loaded before.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SHARED = Path(__file__).resolve().parents[2] / "shared"
# Files that take longest begin first, so that two workers end together: whole runs of Snakemake,
# installs, searches. In falling order of their CPU time.
LONGEST = (
    *("workflow/test_whole_run", "snakemake-executor-plugin-warm", "workflow/test_module"),
    *("workflow/test_run", "workflow/test_small_campaigns", "effects/test_group.py"),
    *("effects/test_model", "effects/test_search", "effects/test_ways", "effects/test_given"),
)


def pytest_configure(config):
    """Hand files to workers in the order of collection, not those with the most tests first."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(items):
    """Put the files that take longest first; the order within a file and of the others stays."""

    def place(item):
        path = item.path.as_posix()
        return next((k for k, name in enumerate(LONGEST) if name in path), len(LONGEST))

    items.sort(key=place)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the measured campaigns and instrument files; the test is skipped where absent."""
    if not SHARED.is_dir():
        pytest.skip("measured data (../shared) are not on this machine")
    return SHARED


class Named(list):
    """Values that can be reached by position and by name, as Snakemake's are."""

    def __init__(self, values=(), **named):
        super().__init__([*values, *named.values()])
        self.__dict__.update(named)

    def items(self):
        return self.__dict__.items()

    def get(self, key, default=None):
        return self.__dict__.get(key, default)


@pytest.fixture
def snakemake(tmp_path, monkeypatch):
    """Factory of script objects that write below a temporary campaign, the working directory."""
    monkeypatch.chdir(tmp_path)

    def make(*outputs, inputs=(), wildcards=None, **params):
        return SimpleNamespace(
            rule="toy",
            input=Named(inputs),
            output=Named(outputs),
            params=Named(**params, code="abc"),
            wildcards=Named(**(wildcards or {"cell": "A", "test": "t"})),
            log=["job.log"],
        )

    return make


@pytest.fixture
def saved(snakemake):
    """Writes an artefact and gives its path; a text as content is the reason why it has none."""
    from cellwright.refusal import Refusal
    from runtime import artefact

    def save(path, content, params=None, **facts):
        below = path.removeprefix("results/").removeprefix("stages/").partition(".")[0]
        names = below.split("/")[1:]
        wildcards = dict(zip(("cell", "test"), names, strict=False))
        with artefact.Job(snakemake(path, wildcards=wildcards, **(params or {}))) as job:
            if isinstance(content, str):
                raise Refusal(content)
            job.save(content, **facts)
        return path

    return save
