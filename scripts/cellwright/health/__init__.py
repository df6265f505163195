"""How a cell ages: peaks with an identity, what it has lost, its fade and state of health."""
