"""A record → one series → a clean series → steps."""

from .assembly import Assembled, assemble
from .cleaning import Cleaned, clean, remove
from .flags import Flag, counts, flag

__all__ = ["Assembled", "Cleaned", "Flag", "assemble", "clean", "counts", "flag", "remove"]
