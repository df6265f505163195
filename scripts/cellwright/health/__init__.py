"""Health of cells over their lives: ageing, capacity lost, fade, knee, degradation, ratings."""
