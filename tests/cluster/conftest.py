"""Lets the tests import the module beside them; what a plain run on this machine makes."""

import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from two_cells import TARGETS, artefacts, command, write_campaign


@pytest.fixture(scope="session")
def local_artefacts(tmp_path_factory):
    """What a plain run on this machine makes."""
    folder = write_campaign(tmp_path_factory.mktemp("local") / "campaign")
    done = subprocess.run(**command(folder, "--cores", "1", *TARGETS), check=False)
    assert done.returncode == 0, done.stdout
    return artefacts(folder / "results")
