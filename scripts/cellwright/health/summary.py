"""One number of a cell out of many tests: its capacity, its resistance, its latest health."""

from cellwright.health.table import CHECK_UP, CYCLES
from cellwright.records.conditions import REFERENCE_CELSIUS, same_rate, same_temperature


def slowest_capacity(rows):
    """Row of the slowest discharge of the earliest cycle; of charges where none is.

    Cycles of one ageing test differ in the last digits of their rate: the first of them counts.
    None without `rows` (of stage `capacity`, c_rate and cycle None where not known).
    """
    full = [row for row in rows if row["direction"] == "discharge"] or rows
    if not full:
        return None
    rated = [row for row in full if row["c_rate"]]
    slowest = min((row["c_rate"] for row in rated), default=None)
    alike = [row for row in rated if same_rate(row["c_rate"], slowest)] or full
    return min(alike, key=lambda row: row["cycle"] or 0)


def reference_resistance(rows):
    """Row of the first sample of the discharge pulse nearest 50 ± 10 % SoC at 25 °C.

    Of several `rows` of stage `resistance` the earliest, then the one nearest in SoC, then in rate
    to 1C; None where there is no such pulse.
    """
    near = [
        row
        for row in rows
        if row["direction"] == "discharge"
        and row["delay_second"] == 0
        and same_temperature(row["ambient_temperature_celsius"], REFERENCE_CELSIUS)
        and abs(row["soc"] - 0.5) <= 0.1
    ]
    away = [(r["cycle"] or 0, abs(r["soc"] - 0.5), abs((r["c_rate"] or 0.0) - 1)) for r in near]
    return near[away.index(min(away))] if near else None


def latest_health(rows):
    """The last row of a life: counted capacity before what models tell, a check-up before a cycle.

    Of `rows` of stage `health` of one cell; None where it was not seen aged.
    """
    aged = [row for row in rows if row["cycle"] > 0 and row["soh"] == row["soh"]]
    # A check-up and cycles count a whole discharge.
    counted = [row for row in aged if row["method"] in (CHECK_UP, CYCLES)]
    # By name a check-up stands after the ageing cycles, which are faster.
    return max(counted or aged, key=lambda row: (row["cycle"], row["method"]), default=None)


def surest_late(rows):
    """The row (not none) of the least soh_std (None: not known) in a life's last twentieth."""
    last = max(row["cycle"] or 0 for row in rows)
    late = [row for row in rows if (row["cycle"] or 0) >= 0.95 * last]
    return min(late, key=lambda row: float("inf") if row["soh_std"] is None else row["soh_std"])
