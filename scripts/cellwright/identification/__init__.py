"""Models of cells from their tests."""
