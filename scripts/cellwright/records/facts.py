"""Facts of cells, tests and branches from a campaign's sheets, as typed values."""

from typing import NamedTuple


class CellFacts(NamedTuple):
    """A cell as its sheet describes it.

    cell : name.
    rated_capacity_ampere_hour : rated capacity [Ah], None where not stated.
    lower_cutoff_volt, upper_cutoff_volt : limits of the voltage [V], None where not stated.
    state_of_health : capacity over the rating at its first check-up, known from elsewhere [1].
    """

    cell: str
    rated_capacity_ampere_hour: float | None = None
    lower_cutoff_volt: float | None = None
    upper_cutoff_volt: float | None = None
    state_of_health: float | None = None


def stated_capacity(rated_capacity_ampere_hour, state_of_health=None):
    """Capacity of a cell without a capacity test [Ah], from what its sheet states, and its source.

    Parameters
    ----------
    rated_capacity_ampere_hour, state_of_health : of the sheet [Ah], [1], each None where blank.

    Returns
    -------
    capacity : rating times state of health, else the rating, else None. source : in words.
    """
    if rated_capacity_ampere_hour and state_of_health:
        source = f"rating times the stated state of health, {state_of_health:g}"
        return rated_capacity_ampere_hour * state_of_health, source
    return rated_capacity_ampere_hour, "rating"


class TestFacts(NamedTuple):
    """A test as its sheet describes it.

    test : name, of one cell or parallel group.
    kind : capacity, ocv, hppc, pulse_resistance, drive, ica, eis, fast_charge, ageing, …
    ambient_temperature_celsius : of the chamber [°C], None where not stated.
    cycle : cycles before the test, None where not stated.
    soc : state of charge at which it was done [1], None where not stated.
    role : "fit", "validation" or "split".
    started : when it began, local date and time as ISO 8601, None where not stated.
    """

    test: str
    kind: str
    ambient_temperature_celsius: float | None = None
    cycle: float | None = None
    soc: float | None = None
    role: str = "fit"
    started: str | None = None


class BranchFacts(NamedTuple):
    """A branch of a parallel group as its sheet describes it.

    position : of the branch in the group, from 1. cell : name of its cell.
    wire_resistance_ohm : of its connection [Ω], None where not stated.
    initial_soc : at the start of the group's tests [1], None where not stated.
    """

    position: int
    cell: str
    wire_resistance_ohm: float | None = None
    initial_soc: float | None = None


class MeasuredTest(NamedTuple):
    """A test with what was measured in it: TestFacts, and its clean series, a dict of columns."""

    facts: TestFacts
    series: dict
