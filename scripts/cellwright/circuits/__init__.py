"""Equivalent circuits as data: their simulation, temperature, model files."""
