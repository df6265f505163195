"""The same pulses identified by each method of the thesis, by lmfit and by ours, side by side.

No part of the daily run: `snakemake methods`.
"""
