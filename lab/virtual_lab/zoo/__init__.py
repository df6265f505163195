"""Cells by other hands than the laboratory's generators, on which the search is judged.

`forms` : behavioural cells whose effects have other equations than those of `virtual_lab.fast` and
`virtual_lab.hidden`. `physics_cells` : cells by physics with an effect inside, beside healthy
references. `planted` : effects of known size added to real records. Instruments, drives and file
writers are shared with the laboratory, cell equations and constants are not.
"""
