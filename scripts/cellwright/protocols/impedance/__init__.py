"""Impedance spectra: circuits, their fit, and whether a spectrum can be fitted at all."""

from cellwright.protocols.impedance.analysis import analyse
from cellwright.protocols.impedance.course import follow

__all__ = ["analyse", "follow"]
