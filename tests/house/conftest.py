"""Lets the house's tests share what they are held against, `tree`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
