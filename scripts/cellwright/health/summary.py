"""One number of a cell out of many tests: its capacity, its resistance, its latest health."""

from cellwright.health.table import CHECK_UP, CYCLES
from cellwright.records.conditions import REFERENCE_CELSIUS, same_rate, same_temperature

COUNTED = (CHECK_UP, CYCLES)  # methods that count a whole discharge
HALF_SOC, NEAR_HALF = 0.5, 0.1
LATE = 0.95  # of the last cycle: the last twentieth of a life


def slowest_capacity(rows):
    """Capacity of the slowest discharge of the earliest cycle [Ah]; of charges where none is.

    Cycles of one ageing test differ in the last digits of their rate: the first of them counts.

    Parameters
    ----------
    rows : list of dict: direction, c_rate [1/h], cycle (both None where not known),
        capacity_ampere_hour.

    Returns
    -------
    capacity : float, None without rows.
    """
    full = [row for row in rows if row["direction"] == "discharge"] or rows
    if not full:
        return None
    rated = [row for row in full if row["c_rate"]]
    slowest = min((row["c_rate"] for row in rated), default=None)
    alike = [row for row in rated if same_rate(row["c_rate"], slowest)] or full
    return float(min(alike, key=lambda row: row["cycle"] or 0)["capacity_ampere_hour"])


def reference_resistance(rows):
    """First-sample resistance of the discharge pulse nearest 50 ± 10 % SoC at 25 °C [ohm].

    Of several the earliest, then the one nearest in SoC, then in rate to 1C.

    Parameters
    ----------
    rows : list of dict: direction, delay_second [s], soc [1], c_rate [1/h], cycle or None,
        ambient_temperature_celsius [degC] or None, resistance_ohm.

    Returns
    -------
    resistance : float, None where there is no such pulse.
    """
    near = [
        row
        for row in rows
        if row["direction"] == "discharge"
        and row["delay_second"] == 0
        and same_temperature(row["ambient_temperature_celsius"], REFERENCE_CELSIUS)
        and abs(row["soc"] - HALF_SOC) <= NEAR_HALF
    ]
    best = min(near, key=_from_the_reference, default=None)
    return None if best is None else best["resistance_ohm"]


def _from_the_reference(row):
    return row["cycle"] or 0, abs(row["soc"] - HALF_SOC), abs((row["c_rate"] or 0.0) - 1)


def latest_health(rows):
    """The last row of a life: counted capacity before what models tell, a check-up before a cycle.

    Parameters
    ----------
    rows : list of dict: cycle, soh, method, of one cell; NaN where not known.

    Returns
    -------
    row : dict, None where the cell was not seen aged.
    """
    told = [row for row in rows if row["cycle"] > 0 and row["soh"] == row["soh"]]
    counted = [row for row in told if row["method"] in COUNTED]
    # By name a check-up stands after the ageing cycles, which are faster.
    return max(counted or told, key=lambda row: (row["cycle"], row["method"]), default=None)


def surest_late(rows):
    """The row with the least standard deviation among those of the last twentieth of the cycles.

    Parameters
    ----------
    rows : list of dict: cycle, soh_std, None where not known; not empty.
    """
    last = max(row["cycle"] or 0 for row in rows)
    late = [row for row in rows if (row["cycle"] or 0) >= LATE * last]
    return min(late, key=lambda row: float("inf") if row["soh_std"] is None else row["soh_std"])
