"""Health of cells over their lives: fade, knee, remaining cycles, degradation, ratings."""
