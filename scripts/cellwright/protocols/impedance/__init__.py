"""Impedance spectra: circuits, their fit, and whether a spectrum can be fitted at all."""
