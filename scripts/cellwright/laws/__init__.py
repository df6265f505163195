"""How quantities change with temperature, with cycles and across cells of a type."""
