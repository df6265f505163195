"""What several test rooms share: the measured campaigns, where they lie beside the repository."""

import os
import sys
from pathlib import Path

import pytest

# Small matrices: threads of the linear algebra only wait for each other, tens of times longer
# where the machine is shared. Heeded where numpy has not been loaded before.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Cells, records and spectra whose truth is known, which several rooms are held against.
sys.path.insert(0, str(Path(__file__).parent / "known"))

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the measured campaigns and instrument files; the test is skipped where absent."""
    if not SHARED.is_dir():
        pytest.skip("measured data (../shared) are not on this machine")
    return SHARED
