"""Incremental capacity of constant-current charges, its methods, and its peaks."""
