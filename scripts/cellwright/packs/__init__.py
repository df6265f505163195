"""Cells together."""
