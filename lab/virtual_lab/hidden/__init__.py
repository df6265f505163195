"""Cells with a hidden effect of known kind and strength, to test the search for missing effects.

Simulated by the fast generator; nothing here is known to the models that are fitted to the files.
"""
