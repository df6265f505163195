"""Scores of a campaign's results: the pipeline's tables compared with what is true.

Reads plain files only, `<campaign>/results/` and `<campaign>/truth/`; runs without any generator.
"""
