"""Open-circuit voltage from slow tests, rests and chamber steps."""
