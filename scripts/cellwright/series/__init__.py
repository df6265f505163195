"""One clean series from the readings of a test, and its steps."""

from cellwright.series.cleaning import Cleaned, Flag, clean, counts, flag, remove
from cellwright.series.joining import Assembled, assemble

__all__ = ["Assembled", "Cleaned", "Flag", "assemble", "clean", "counts", "flag", "remove"]
