"""How well missing effects are found, measured on hidden campaigns of the virtual laboratory.

`loading`, `answers`, `controls` and `batch` see raw files and sheets alone; `scoring` and what
follows it see the truth.
"""
