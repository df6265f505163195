"""Does the laboratory make records like real ones? Four figures, numbers, and a page about both.

The only part of the laboratory that uses the pipeline, and of it only what reads files and cuts
records into steps, so that real and simulated records go through the same hands.
"""
