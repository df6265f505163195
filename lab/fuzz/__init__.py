"""Records made wrong in known ways, and whether the numbers taken from them say so."""
