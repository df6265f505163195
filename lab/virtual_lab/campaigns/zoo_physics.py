"""The zoo's cells by physics as a campaign of the laboratory, one job a cell."""

from virtual_lab.zoo.physics_cells import plan

__all__ = ["plan"]
