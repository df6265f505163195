"""One of each numeric tool: arrays in, arrays out, nothing of batteries."""
