"""Full discharges and charges: capacity, and constant-current charges for dQ/dV."""

from virtual_lab.protocols.steps import HOUR, MINUTE, Step, charge, discharge, hold, rest
from virtual_lab.rating import Rating


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
