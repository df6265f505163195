"""How well missing effects are found, measured on hidden campaigns of the virtual laboratory.

`campaign`, `answers`, `controls` and `batch` see raw files and sheets alone; `truth`, `scoring`
and `page` see the truth.
"""
