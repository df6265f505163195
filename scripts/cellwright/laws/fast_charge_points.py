"""The points over temperature that the laws of fast charge are fitted to."""

from cellwright.laws.points import Point, fresh

SAME_RATE = 1.1


def fast_charge_points(rows):
    """What a fast charge puts in, and how, at each temperature; one quantity per rate.

    Parameters
    ----------
    rows : list of dict, of stage `fast_charge` with ambient_temperature_celsius and cycle.

    Returns
    -------
    points : list of Point: share charged in the minutes asked for, the ratio of charged to not
        charged (which the resistance sets once the voltage limits the charge, so that it may
        follow an Arrhenius law where the share, bounded by 1, cannot), the share at constant
        current, minutes to 80 % where that was reached; from empty and of the earliest check-up
        only.
    """
    mine = sorted(
        (row for row in fresh(rows) if row["from_empty"]),
        key=lambda row: (-row["ambient_temperature_celsius"], row["c_rate"]),
    )
    rates, found = [], []
    for row in mine:
        # The set current shows at warm temperatures; in the cold the voltage cuts it at once.
        near = [rate for rate in rates if row["c_rate"] <= SAME_RATE * rate]
        rates += [] if near else [row["c_rate"]]
        rate = near[0] if near else row["c_rate"]
        found += [
            Point(f"{name} at up to {rate:.2g}C", unit, row["ambient_temperature_celsius"], value)
            for name, unit, value in _quantities(row)
            if value > 0
        ]
    return found


def _quantities(row):
    yield f"share charged in {row['minutes']:g} min", "1", row["share"]
    if row["share"] < 1:
        ratio = row["share"] / (1 - row["share"])
        yield f"charged over not charged in {row['minutes']:g} min", "1", ratio
    yield "share of it at constant current", "1", row["constant_current_share"]
    yield "time to 80 %", "min", row["minutes_to_80"]
