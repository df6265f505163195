"""What is true about a test, without noise, from what its cell really did."""

from virtual_lab.truth.charges import capacity_rows, cycle_rows, soc_rows
from virtual_lab.truth.groups import group_rows
from virtual_lab.truth.peaks import ica_rows
from virtual_lab.truth.resistances import resistance_rows
from virtual_lab.truth.tables import rows

__all__ = [
    "capacity_rows",
    "cycle_rows",
    "group_rows",
    "ica_rows",
    "resistance_rows",
    "rows",
    "soc_rows",
]
