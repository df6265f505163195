"""What one test tells: capacity, resistance, relaxation, dQ/dV, OCV, impedance."""
