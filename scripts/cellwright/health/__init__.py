"""State of health: tracked peaks, degradation modes, fade, knee and remaining life."""
