"""How well missing effects are found, measured on hidden campaigns of the virtual laboratory.

`campaign`, `answers` and `controls` read raw files and sheets alone; `scoring` and `page` read the
truth.
"""
