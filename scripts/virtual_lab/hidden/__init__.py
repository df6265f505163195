"""Cells with a hidden effect of known kind and strength, to try the missing-effect search on.

Simulated by the fast generator; nothing here is known to the models that are fitted to the files.
"""
