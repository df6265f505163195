"""Cells in parallel: how they share a current, and models found from it."""
