"""What was stated of a cell and its tests, and what of it seems to be wrong."""
