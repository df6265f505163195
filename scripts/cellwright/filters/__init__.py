"""State of charge online: Kalman filters on a cell's model, and their scores."""
