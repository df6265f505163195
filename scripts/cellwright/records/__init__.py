"""A test laid out on the SoC scale: what SoC refers to, and the rows a fit may use."""
