"""Cells with hidden effects made by equations that the search for effects does not know."""
