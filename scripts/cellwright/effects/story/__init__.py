"""A verdict told for people: one sentence, sizes as they are used, what is unsure and left."""
