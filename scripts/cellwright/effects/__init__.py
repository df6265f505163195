"""The missing effect: where model and measurement disagree, what is missing, and the proof."""
