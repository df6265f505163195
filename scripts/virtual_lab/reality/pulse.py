"""What the voltage does when a steady current begins out of a rest: (V(t) − V(0)) / I."""

import numpy as np

from virtual_lab.reality.findings import Curve, numbers

FINEST_SECOND = 1.1
SHORTEST_SECOND = 9.5
TIMES_SECOND = (0.1, 1.0, 3.0)
WHOLE_SECOND = 10.0
FAST_CURRENT = 0.98
LEAST_C_RATE = 0.25


def response(record, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds since the edge, and resistance [ohm], of one step's samples.

    The edge lies between the last sample at rest and the first under load, not further back than
    the next interval is long; its middle is taken. The current of each sample divides. The voltage
    at rest is that of the three last samples which lies furthest from the load's, for with some
    instruments it drops a sample before the current shows.
    """
    first, last = record.steps.first_row[step], record.steps.last_row[step]
    rows = np.arange(first, last + 1)
    furthest = np.min if record.steps.current_mean_ampere[step] > 0 else np.max
    level = furthest(record.volt[max(first - 3, 0) : first])
    rows = rows[np.abs(record.ampere[rows]) > 0.5 * abs(record.steps.current_mean_ampere[step])]
    begin = record.second[first] - 0.5 * _doubt(record.second, first)
    return record.second[rows] - begin, (record.volt[rows] - level) / record.ampere[rows]


def _doubt(second, first) -> float:
    """Length [s] of the time in which the edge may lie."""
    return float(np.diff(second[first - 1 : first + 2]).min())


def edges(record):
    """Steps of one current that begin out of a rest, dense enough to see 10 s."""
    steps = record.steps
    for index in np.flatnonzero(np.isin(steps.kind, ("pulse", "CC"))):
        first, last = steps.first_row[index], steps.last_row[index]
        calm = index > 0 and steps.kind[index - 1] == "rest"
        if not calm or steps.c_rate[index] < LEAST_C_RATE or last - first < 8:
            continue
        second = record.second[first - 1 : last + 1]
        if second[-1] - second[1] < SHORTEST_SECOND or second[1] - second[0] > 60.0:
            continue
        if np.diff(second[1:9]).max() <= FINEST_SECOND:
            yield index


def describe(second: np.ndarray, ohm: np.ndarray, *, rating_ampere_hour: float) -> dict:
    """Resistance after 0.1, 1 and 3 s over that after 10 s, and that one's size.

    Times before the first sample are left out.
    """
    whole = float(np.interp(min(WHOLE_SECOND, second[-1]), second, ohm))
    times = [time for time in TIMES_SECOND if second[0] <= time]
    found = {
        f"resistance after {time:g} s over that after 10 s": (
            np.interp(time, second, ohm) / whole,
            "1",
        )
        for time in times
    }
    return found | {
        "resistance after 10 s": (1e3 * whole, "mohm"),
        "resistance after 10 s times rating": (1e3 * whole * rating_ampere_hour, "mohm·Ah"),
    }


def look(record):
    """Numbers and curves of a record's loads out of a rest."""
    found, curves = [], []
    about = (record.source.name, record.cell, record.test)
    for step in edges(record):
        second, ohm = response(record, step)
        c_rate = record.steps.c_rate[step]
        way = "charge" if record.steps.current_mean_ampere[step] > 0 else "discharge"
        row = describe(second, ohm, rating_ampere_hour=record.rating_ampere_hour)
        row |= {"C-rate": (c_rate, "1/h"), "time to full current": (_rise(record, step), "ms")}
        found += numbers(record, step, "pulse", f"{way} out of a rest", row)
        inside = (second > 0) & (second <= 1.02 * WHOLE_SECOND)
        whole = row["resistance after 10 s"][0] / 1e3
        curves.append(Curve(*about, way, second[inside], ohm[inside] / whole))
    return found, curves


def _rise(record, step) -> float:
    """Time [ms] from the first sample under load to the first at 98 % of the current."""
    rows = np.arange(record.steps.first_row[step], record.steps.last_row[step] + 1)
    plateau = np.median(record.ampere[rows])
    full = rows[np.argmax(record.ampere[rows] / plateau >= FAST_CURRENT)]
    return 1e3 * float(record.second[full] - record.second[rows[0]])
