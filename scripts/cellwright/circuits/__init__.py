"""A circuit as data: simulated, over temperature, as a model file."""
