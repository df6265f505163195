"""Models of cells without pulses: the reference cell's, corrected by what the cell shows."""
