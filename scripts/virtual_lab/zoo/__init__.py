"""Cells by other hands than the laboratory's generators, on which the search is judged.

`forms` makes campaigns of behavioural cells whose effects have other equations than those of
`virtual_lab.fast` and `virtual_lab.hidden`. It shares instruments, drives and file writers with the
laboratory, and neither cell equations nor constants.
"""
