"""Cells that the search for missing effects is judged on, made otherwise than its benchmark."""
