"""Packs: how cells are wired, simulated together, identified in a group, and decided on."""
