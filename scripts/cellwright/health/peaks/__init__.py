"""Peaks of dQ/dV over a life and over temperature, and the state of health that they tell."""
