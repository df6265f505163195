"""How sure the cells of a pack are known, and what that leaves of its currents and voltage."""
