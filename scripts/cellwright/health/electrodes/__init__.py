"""Half cells aligned to a cell: lithium and active material lost, plateaus."""
