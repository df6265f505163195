"""Functional mock-up units (FMI 3.0, co-simulation) of cells and packs, for other simulators."""
