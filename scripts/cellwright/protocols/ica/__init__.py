"""Incremental capacity of constant-current charges, and its peaks."""
