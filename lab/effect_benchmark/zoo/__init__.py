"""The search for missing effects judged on cells by several hands: searched, judged, on one page.

`searching` reads raw files and sheets alone, as a run of the pipeline; `judging` reads the truth.
`python -m effect_benchmark.zoo FOLDER` searches the cells of one folder and prints a line a cell.
"""
