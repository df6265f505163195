"""How quantities change with temperature, state of charge and rate, and across cells of a type."""
