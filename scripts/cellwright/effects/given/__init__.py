"""Bases of the search that are given more: healthy references, a model in use, any simulator."""
