"""Cells in series: a string simulated from its cells, what it can give, and what limits it."""
