"""What a campaign's sheets say of a cell and of a test: the facts that analyses need."""

from typing import NamedTuple


class CellFacts(NamedTuple):
    """A cell as its sheet describes it.

    cell : name.
    rated_capacity_ampere_hour : rated capacity [Ah], None where not stated.
    lower_cutoff_volt, upper_cutoff_volt : limits of the voltage [V], None where not stated.
    """

    cell: str
    rated_capacity_ampere_hour: float | None = None
    lower_cutoff_volt: float | None = None
    upper_cutoff_volt: float | None = None


class TestFacts(NamedTuple):
    """A test as its sheet describes it.

    test : name, of one cell or parallel group.
    kind : capacity, ocv, hppc, pulse_resistance, drive, ica, eis, fast_charge, ageing, …
    ambient_temperature_celsius : of the chamber [°C], None where not stated.
    cycle : cycles before the test, None where not stated.
    soc : state of charge at which it was done [1], None where not stated.
    role : "fit", "validation" or "split".
    """

    test: str
    kind: str
    ambient_temperature_celsius: float | None = None
    cycle: float | None = None
    soc: float | None = None
    role: str = "fit"
