"""What is true about cells: arrays in, arrays out."""
