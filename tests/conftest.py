"""What several test rooms share: the measured campaigns, where they lie beside the repository."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the measured campaigns and instrument files; the test is skipped where absent."""
    if not SHARED.is_dir():
        pytest.skip("measured data (../shared) are not on this machine")
    return SHARED
