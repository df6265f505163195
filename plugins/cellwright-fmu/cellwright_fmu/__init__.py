"""Functional mock-up units (FMI 3.0, co-simulation) of cells and packs, for other simulators."""

from cellwright_fmu.units import Fmu, cell_fmu, pack_fmu

__all__ = ["Fmu", "cell_fmu", "pack_fmu"]
