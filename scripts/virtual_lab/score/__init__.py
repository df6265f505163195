"""What a campaign's results are worth: the pipeline's tables held against what is true.

Reads plain files only, `<campaign>/results/` and `<campaign>/truth/`; runs without any generator.
"""
