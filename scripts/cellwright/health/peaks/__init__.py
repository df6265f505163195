"""State of health from peaks of dQ/dV: features of peaks, estimates, their calibration."""
