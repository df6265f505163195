"""Impedance spectra: circuits, their fit, and whether a spectrum can be fitted at all."""

from cellwright.protocols.impedance.analysis import analyse

__all__ = ["analyse"]
