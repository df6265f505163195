"""What a laboratory reads on a cell's data sheet."""

from typing import NamedTuple


class Rating(NamedTuple):
    """Capacity [Ah] on the data sheet, to which C-rates refer, and the two cut-offs [V]."""

    capacity_ampere_hour: float
    lower_cutoff_volt: float
    upper_cutoff_volt: float

    def ampere(self, c_rate: float) -> float:
        """Current [A] of a C-rate."""
        return c_rate * self.capacity_ampere_hour
