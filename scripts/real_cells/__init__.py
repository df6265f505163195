"""The yardstick: what a campaign's finished results are worth, as numbers with tolerances.

Reads plain files of `results/` only; computes nothing about cells that the pipeline did not.
"""
