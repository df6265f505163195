"""A stand-in for Snakemake's script object, for tests of what scripts use."""

from types import SimpleNamespace

import pytest


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
