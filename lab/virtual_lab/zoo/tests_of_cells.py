"""Tests that each behavioural cell goes through, and what the sheets say of them."""

from functools import cache
from typing import NamedTuple

from virtual_lab import protocols
from virtual_lab.behaviour import Rating
from virtual_lab.protocols import Step

UNIT = Rating(1.0, 0.0, 1.0)  # C-rates for currents; its cut-offs stand for those of each cell


class Test(NamedTuple):
    """A test: id, kind, chamber temperature [°C], steps, role."""

    test: str
    kind: str
    celsius: float
    steps: tuple[Step, ...]
    role: str


# Temperatures of the drives that are fitted, and of those that judge.
LAYOUTS = {
    "wide": ((25.0, 8.0, 40.0), (25.0, 15.0)),
    "cold": ((25.0, 5.0, 35.0), (10.0, 30.0)),
    "one": ((25.0, 25.0, 25.0), (25.0, 25.0)),
    "unproven": ((25.0, 8.0, 40.0), (25.0, 25.0)),
}
FIRST_DRIVE = 3  # place of the first drive among the tests


@cache
def tests(layout: str, *, held: bool) -> tuple[Test, ...]:
    """Tests of a layout, in the order in which they are made.

    Parameters
    ----------
    layout : a name of LAYOUTS. held : whether the slow charge ends with a hold.
    """
    fitted, judging = LAYOUTS[layout]
    slow = protocols.slow_ocv(UNIT, c_rate=1 / 20, period_second=90.0)
    slow = [*slow[:-1], protocols.hold(UNIT, until_c_rate=1 / 50), slow[-1]] if held else slow
    full = protocols.capacity(UNIT, repeats=1, c_rate=1 / 2, period_second=20.0)
    pulses = protocols.hybrid_pulses_below_full(
        UNIT, 0.98, discharge_c_rate=1.2, charge_c_rate=0.8, rest_second=1800.0, period_second=20.0
    )
    styles = (("soft", 41), ("harsh", 42), ("soft", 43), ("harsh", 44), ("soft", 45))
    drives = [
        protocols.dynamic_load(UNIT, style=style, seed=seed, ampere_hour=0.78, duration_second=3600)
        for style, seed in styles
    ]
    rows = [
        Test("capacity_25C", "capacity", 25.0, tuple(full), "fit"),
        Test("ocv_25C", "ocv", 25.0, tuple(slow), "fit"),
        Test("hppc_25C", "hppc", 25.0, tuple(pulses), "fit"),
    ]
    for number, (celsius, steps) in enumerate(zip(fitted + judging, drives, strict=True), 1):
        role = "fit" if number <= len(fitted) else "validation"
        rows.append(Test(f"drive_{number}_{celsius:g}C", "drive", celsius, tuple(steps), role))
    return tuple(rows)
