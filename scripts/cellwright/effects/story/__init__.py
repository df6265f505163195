"""A verdict told for people: in a sentence, with sizes as used; what is unsure, and stable."""
