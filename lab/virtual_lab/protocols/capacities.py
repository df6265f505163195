"""Full discharges and charges: capacity tests, charges for dQ/dV, ageing cycles, fast charge."""

from collections.abc import Callable
from typing import NamedTuple

from virtual_lab.behaviour import Behaviour, Rating
from virtual_lab.protocols.steps import HOUR, MINUTE, Step, charge, discharge, hold, rest


def capacity(
    rating: Rating,
    *,
    repeats: int = 3,
    c_rate: float = 1 / 2,
    until_c_rate: float = 1 / 20,
    hold_empty: bool = False,
    rest_second: float = HOUR,
    period_second: float = 10.0,
) -> list[Step]:
    """Discharge, rest, CCCV charge, rest; repeated (thesis 4.3: 0.5C, C/20, 1 h, three times).

    Parameters
    ----------
    rating : of the cell.
    repeats : how often.
    c_rate : of discharge and charge [1/h].
    until_c_rate : at which a hold ends [1/h].
    hold_empty : the discharge, too, ends with a hold.
    rest_second, period_second : of each rest, and between samples of the loads [s].
    """
    down = [discharge(rating, c_rate, period_second=period_second)]
    down += [hold(rating, until_c_rate=until_c_rate, empty=True)] if hold_empty else []
    up = [
        charge(rating, c_rate, period_second=period_second),
        hold(rating, until_c_rate=until_c_rate),
    ]
    once = [*down, rest(rest_second), *up, rest(rest_second)]
    return [rest(MINUTE, period_second=5.0), *once * repeats]


def incremental_capacity(
    rating: Rating,
    *,
    c_rate: float = 1 / 20,
    emptying_c_rate: float = 1 / 20,
    period_second: float = 10.0,
) -> list[Step]:
    """C/2 and then a slow discharge until empty, 1 h rest, a charge of constant current.

    Parameters
    ----------
    rating : of the cell.
    c_rate : of the charge [1/h]: C/30 to C/20, in vehicles up to 2C (thesis 4.4).
    emptying_c_rate : of what is left after the C/2 discharge [1/h].
    period_second : between samples of the charge [s].
    """
    return [
        rest(MINUTE, period_second=5.0),
        discharge(rating, 1 / 2, period_second=30.0),
        rest(10 * MINUTE),
        discharge(rating, emptying_c_rate, period_second=30.0),
        rest(HOUR),
        charge(rating, c_rate, period_second=period_second),
        rest(10 * MINUTE),
    ]


Run = Callable[[list[Step]], list[Behaviour]]


class Ageing(NamedTuple):
    """C-rates of an ageing protocol [1/h]; `held`: the charge ends with a hold (CV)."""

    discharge_c_rate: float
    charge_c_rate: float
    held: bool


AGEING = {
    "standard": Ageing(1.0, 1.0, held=True),
    "high_power": Ageing(3.0, 1.0, held=False),
    "fast_charge": Ageing(2.0, 2.0, held=False),
}


def ageing_cycle(
    rating: Rating,
    protocol: str,
    *,
    discharge_c_rate: float | None = None,
    rest_second: float = 10 * MINUTE,
    period_second: float = 60.0,
) -> list[Step]:
    """Discharge, rest, charge, rest.

    Parameters
    ----------
    rating : of the cell.
    protocol : a name of AGEING: standard (1C, CCCV at 1C to C/20), high_power (2C to 5C, CC at 1C),
        fast_charge (2C, CC at 2C).
    discharge_c_rate : in place of the protocol's [1/h].
    rest_second, period_second : of both rests, and between samples [s].
    """
    kind = AGEING[protocol]
    down = discharge_c_rate or kind.discharge_c_rate
    period = {"period_second": period_second}
    up = [charge(rating, kind.charge_c_rate, **period)]
    up += [hold(rating, period_second=period_second)] if kind.held else []
    pause = rest(rest_second, **period)
    return [discharge(rating, down, **period), pause, *up, pause]


def ageing_cycles(rating: Rating, protocol: str, *, cycles: int, **options) -> list[Step]:
    """An ageing test of several cycles; `options` are those of `ageing_cycle`."""
    return [rest(MINUTE, period_second=5.0), *ageing_cycle(rating, protocol, **options) * cycles]


def fast_charge(
    rating: Rating,
    *,
    run: Run | None = None,
    c_rate: float = 2.0,
    longest_second: float = 0.5 * HOUR,
    period_second: float = 1.0,
) -> list[Step]:
    """2C charge from empty to the upper cut-off, then a hold; 30 min in all (thesis 3.3: S10).

    A full cell is emptied first, at C/2 and then at C/20, and rests for an hour.

    Parameters
    ----------
    rating : of the cell.
    run : simulates the cell in steps. A cycler counts constant current and hold together; here the
        charge is simulated first to learn how long the hold may last. Without it no hold.
    c_rate : of the charge [1/h].
    longest_second : of the charge [s].
    period_second : between its samples [s].
    """
    constant = charge(rating, c_rate, period_second=period_second)
    steps = [
        rest(MINUTE, period_second=5.0),
        discharge(rating, 1 / 2, period_second=30.0),
        discharge(rating, 1 / 20, period_second=30.0),
        rest(HOUR),
        constant._replace(duration_second=longest_second),
    ]
    remaining = longest_second - run(steps)[-1].duration_second if run else 0.0
    if remaining >= 1.0:
        period = {"longest_second": round(remaining, 3), "period_second": period_second}
        steps.append(hold(rating, **period))
    return [*steps, rest(30 * MINUTE)]


def group_capacity(
    rating: Rating, *, c_rate: float = 1.0, charge_c_rate: float = 0.5, period_second: float = 5.0
) -> list[Step]:
    """CC discharge of a parallel group, rest, CCCV charge, rest (thesis 5.2: 1C and 2C).

    `rating` is that of the group: the sum of its cells' capacities, one cell's cut-offs. In the
    rests the cells go on exchanging charge.
    """
    still = rest(HOUR, period_second=period_second)
    return [
        rest(5 * MINUTE, period_second=5.0),
        discharge(rating, c_rate, period_second=period_second),
        still,
        charge(rating, charge_c_rate, period_second=period_second),
        hold(rating),
        still,
    ]
