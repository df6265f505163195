"""A test laid out on the SoC scale."""
