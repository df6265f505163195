"""Puts the true cell beside the tests."""

import os
import sys
from pathlib import Path

# Small matrices: threads of the linear algebra only wait for each other, tens of times longer
# where the machine is shared. Heeded where numpy has not been loaded before.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))
