"""Figures for people: columns of artefacts in, matplotlib figures out, in one style."""
