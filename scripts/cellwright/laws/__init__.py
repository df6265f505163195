"""How quantities move with temperature, cycle and fleet."""
