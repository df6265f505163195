"""Numbers of campaigns of real cells, and their check against recorded ones with tolerances.

Reads plain files of `results/` only; computes nothing about cells that the pipeline did not.
"""
