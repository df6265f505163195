"""State of charge online."""
