"""Ways in which a record or its sheet goes wrong, each as a function of a clean record.

A record is columns as a file holds them (`Test Time / s` …) and the facts of its cell and test. A
kind changes one or the other; `text` kinds change the file's text. Benign kinds change nothing that
a number hangs on: they must raise no doubt.
"""

import numpy as np

from fuzz.kinds_of_columns import BENIGN_COLUMNS, KINDS_OF_COLUMNS
from fuzz.record import (
    CHARGED,
    CURRENT,
    CUTOFFS,
    DISCHARGED,
    SHORT,
    SURFACE,
    TIME,
    VOLTAGE,
    block,
    row_count,
    spot,
)


def _from(record, rng, name, change):
    """A column changed from a row under load on."""
    values, row = record.columns[SHORT[name]].copy(), spot(record, rng)
    values[row:] = change(values[row:])
    return record.having(**{name: values})


def _at_block(record, rng, name, share, change):
    values, rows = record.columns[SHORT[name]].copy(), block(record, rng, share)
    values[rows] = change(values[rows])
    return record.having(**{name: values})


def _scaled(name, factor):
    return lambda record, rng: record.having(**{name: record.columns[SHORT[name]] * factor(rng)})


def _one_of(*factors):
    return lambda rng: float(rng.choice(factors))


def _between(low, high):
    return lambda rng: float(
        rng.uniform(low, high) if rng.random() < 0.5 else 1 / rng.uniform(low, high)
    )


def _offset(record, rng):
    largest = np.abs(record.columns[CURRENT]).max()
    return record.having(
        current=record.columns[CURRENT] + rng.choice((-1, 1)) * largest * rng.uniform(0.02, 0.08)
    )


def _drifting_gain(record, rng):
    gain = np.linspace(1, 1 + rng.choice((-1, 1)) * rng.uniform(0.05, 0.2), row_count(record))
    return record.having(current=record.columns[CURRENT] * gain)


def _clipped(record, rng):
    current = record.columns[CURRENT]
    most = np.abs(current).max() * rng.uniform(0.5, 0.9)
    return record.having(current=np.clip(current, -most, most))


def _rounded(record, rng):
    digit = np.abs(record.columns[CURRENT]).max() * rng.uniform(0.05, 0.2)
    return record.having(current=np.round(record.columns[CURRENT] / digit) * digit)


def _stuck(name):
    return lambda record, rng: _at_block(
        record, rng, name, rng.uniform(0.03, 0.15), lambda v: v * 0 + v[0]
    )


def _dropped_out(record, rng):
    current = record.columns[CURRENT].copy()
    rows = rng.random(row_count(record)) < rng.uniform(0.02, 0.1)
    return record.having(current=np.where(rows, 0.0, current))


def _zero_block(record, rng):
    return _at_block(record, rng, "current", rng.uniform(0.02, 0.1), lambda v: 0 * v)


def _spikes(name, size):
    def kind(record, rng):
        values = record.columns[SHORT[name]].copy()
        rows = rng.choice(row_count(record), max(3, row_count(record) // 500), replace=False)
        values[rows] += rng.choice((-1, 1), len(rows)) * size(values)
        return record.having(**{name: values})

    return kind


def _clock_jump(sign):
    def kind(record, rng):
        jump = sign * rng.uniform(600, 3600)
        return _from(record, rng, "time", lambda t: t + jump)

    return kind


def _day_added(record, rng):
    return _from(record, rng, "time", lambda t: t + 86400.0)


def _clock_restart(record, rng):
    return _from(record, rng, "time", lambda t: t - t[0])


def _without(rows_of):
    """Rows missing, the clock going on."""

    def kind(record, rng):
        kept = np.ones(row_count(record), bool)
        kept[rows_of(record, rng)] = False
        return record.of_rows(np.flatnonzero(kept))

    return kind


def _closed_up(record, rng):
    """A block missing and the clock closed up over it."""
    rows, time = block(record, rng, rng.uniform(0.04, 0.15)), record.columns[TIME].copy()
    time[rows.stop :] -= time[rows.stop] - time[rows.start]
    kept = np.ones(row_count(record), bool)
    kept[rows] = False
    return record.having(time=time).of_rows(np.flatnonzero(kept))


def _block_twice(record, rng):
    rows = np.arange(row_count(record))
    twice = rows[block(record, rng, rng.uniform(0.04, 0.15))]
    return record.of_rows(np.concatenate([rows[: twice[-1] + 1], twice, rows[twice[-1] + 1 :]]))


def _block_twice_clock_on(record, rng):
    """A block repeated, its clock going on as if measured again."""
    found, step = _block_twice(record, rng), np.diff(record.columns[TIME])
    change = np.diff(found.columns[TIME])
    change[change < 0] = np.median(step[step > 0])
    return found.having(time=np.concatenate([[0], np.cumsum(change)]) + found.columns[TIME][0])


def _shuffled(record, rng):
    rows = np.arange(row_count(record))
    mixed = block(record, rng, 0.1)
    rows[mixed] = rng.permutation(rows[mixed])
    return record.of_rows(rows)


def _head_missing(record, rng):
    return record.of_rows(slice(spot(record, rng, 0.05, 0.4), None))


def _tail_missing(record, rng):
    return record.of_rows(slice(0, spot(record, rng, 0.5, 0.97)))


def _step_missing(record, rng):
    """One step between two edges of the current is gone, the clock going on."""
    current = record.columns[CURRENT]
    edges = np.flatnonzero(np.abs(np.diff(current)) > 0.2 * np.abs(current).max()) + 1
    if len(edges) < 3:
        return _closed_up(record, rng)
    k = int(rng.integers(len(edges) - 1))
    kept = np.r_[0 : edges[k], edges[k + 1] : row_count(record)]
    return record.of_rows(kept)


def _cut_text(record, rng):
    share = rng.uniform(0.3, 0.95)
    return record._replace(text=lambda text: text[: int(share * len(text))])


def _damaged_text(bytes_of):
    def kind(record, rng):
        def change(text):
            place = int(rng.uniform(0.1, 0.9) * len(text))
            return text[:place] + bytes_of(rng) + text[place + 1 :]

        return record._replace(text=change)

    return kind


def _cells_replaced(*words):
    """Single values of current or voltage as words or other numbers."""

    def kind(record, rng):
        def change(text):
            lines = text.split("\n")
            for k in rng.choice(np.arange(2, len(lines) - 2), 5, replace=False):
                parts = lines[k].split(",")
                parts[int(rng.integers(1, 3))] = str(rng.choice(words))
                lines[k] = ",".join(parts)
            return "\n".join(lines)

        return record._replace(text=change)

    return kind


def _labels(**labels):
    return lambda record, rng: record._replace(
        labels=record.labels | {SHORT[k]: v for k, v in labels.items()}
    )


def _swapped(record, rng):
    return record.having(current=record.columns[VOLTAGE], voltage=record.columns[CURRENT])


def _fact(name, change, of="cell"):
    def kind(record, rng):
        facts = getattr(record, of)
        if facts.get(name) is None:
            return None
        return record._replace(**{of: facts | {name: change(facts[name], rng)}})

    return kind


def _cutoff(record, rng):
    name = CUTOFFS[int(rng.integers(2))]
    return record._replace(
        cell=record.cell | {name: record.cell[name] + rng.choice((-0.2, -0.1, 0.1, 0.2))}
    )


def _sign_of_part(record, rng):
    return _from(record, rng, "current", lambda c: -c)


def _magnitude(record, rng):
    return record.having(current=np.abs(record.columns[CURRENT]))


def _counter_wrong(record, rng):
    if CHARGED not in record.columns:
        return None
    factor = rng.choice((0.5, 0.9, 1.1, 2.0))
    more = {name: record.columns[name] * factor for name in (CHARGED, DISCHARGED)}
    return record._replace(columns=record.columns | more)


def _celsius_offset(record, rng):
    if SURFACE not in record.columns:
        return None
    shift = rng.choice((273.15, -30.0))
    return record.having(surface=record.columns[SURFACE] + shift)


def _fahrenheit(record, rng):
    if SURFACE not in record.columns:
        return None
    return record.having(surface=record.columns[SURFACE] * 1.8 + 32)


def _as_c_rate(record, rng):
    return record.having(
        current=record.columns[CURRENT] / record.cell["rated_capacity_ampere_hour"]
    )


def _gain_from_the_middle(record, rng):
    gain = _between(1.05, 2.0)(rng)
    return _from(record, rng, "current", lambda c: c * gain)


def _factor(*factors):
    return lambda value, rng: value * rng.choice(factors)


def _sheet_celsius(record, rng):
    name = "ambient_temperature_celsius"
    return _fact(name, lambda v, g: v + g.choice((-25.0, 20.0)), "test")(record, rng)


# Benign: what is the same measurement in other clothes.
def _unchanged(record, rng):
    return record


def _thinned_text(record, rng):
    return record._replace(text=lambda text: text.replace("\n", "\r\n"))


def _time_begins_later(record, rng):
    return record.having(time=record.columns[TIME] + rng.uniform(10, 1e5))


def _last_line_missing(record, rng):
    return record.of_rows(slice(0, row_count(record) - 1))


def _fine_rounding(record, rng):
    return record.having(
        current=np.round(record.columns[CURRENT], 4), voltage=np.round(record.columns[VOLTAGE], 4)
    )


def _in_milli(record, rng):
    columns = {CURRENT: "Current / mA", VOLTAGE: "Voltage / mV"}
    scaled = record.having(
        current=record.columns[CURRENT] * 1e3, voltage=record.columns[VOLTAGE] * 1e3
    )
    return scaled._replace(labels=record.labels | columns)


def _scattered(record, rng):
    kept = np.flatnonzero(rng.random(row_count(record)) > 0.01)
    return record.of_rows(kept)


BENIGN = {
    "unchanged": _unchanged,
    "CRLF": _thinned_text,
    "clock begins later": _time_begins_later,
    "last line missing": _last_line_missing,
    "rounded to 0.1 mA, 0.1 mV": _fine_rounding,
    "in mA and mV": _in_milli,
} | BENIGN_COLUMNS
KINDS = {
    "C-rate under A": _as_c_rate,
    "mA under A": _scaled("current", _one_of(1000.0)),
    "A under mA": _labels(current="Current / mA"),
    "gain of the whole": _scaled("current", _between(1.2, 3.0)),
    "small gain of the whole": _scaled("current", _between(1.03, 1.15)),
    "gain from the middle": _gain_from_the_middle,
    "drifting gain": _drifting_gain,
    "offset": _offset,
    "coarse rounding": _rounded,
    "clipped current": _clipped,
    "stuck current": _stuck("current"),
    "stuck voltage": _stuck("voltage"),
    "drop-outs to zero": _dropped_out,
    "current zero in a block": _zero_block,
    "spikes of current": _spikes("current", lambda c: 0.5 * np.abs(c).max()),
    "spikes of voltage": _spikes("voltage", lambda v: 0.2),
    "clock rate": _scaled("time", _between(1.05, 2.0)),
    "clock in ms": _scaled("time", _one_of(1000.0)),
    "clock in min": _scaled("time", _one_of(1 / 60)),
    "clock in h": _scaled("time", _one_of(1 / 3600)),
    "clock jumps ahead": _clock_jump(1),
    "clock jumps back": _clock_jump(-1),
    "clock begins anew": _clock_restart,
    "a day added": _day_added,
    "rows missing, scattered": _scattered,
    "block missing": _without(lambda r, g: block(r, g, g.uniform(0.04, 0.15))),
    "block missing, closed up": _closed_up,
    "block twice": _block_twice,
    "block twice, clock going on": _block_twice_clock_on,
    "block shuffled": _shuffled,
    "head missing": _head_missing,
    "tail missing": _tail_missing,
    "step missing": _step_missing,
    "cut mid-line": _cut_text,
    "a NUL": _damaged_text(lambda g: "\0"),
    "random bytes": _damaged_text(lambda g: "".join(map(chr, g.integers(33, 126, 20)))),
    "words for numbers": _cells_replaced("n/a", "OverRange", "#NUM!", ""),
    "sentinels": _cells_replaced("-999", "3.4e38", "-9999", "1e30"),
    "decimal comma": lambda r, g: r._replace(text=lambda t: t.replace(".", ",")),
    "columns swapped": _swapped,
    "sign of a part": _sign_of_part,
    "magnitudes": _magnitude,
    "counter wrong": _counter_wrong,
    "rating wrong": _fact("rated_capacity_ampere_hour", _factor(0.1, 0.4, 2.5, 10.0, 1000.0)),
    "cut-off wrong": _cutoff,
    "temperature of the sheet wrong": _sheet_celsius,
    "kelvin or another offset": _celsius_offset,
    "Fahrenheit": _fahrenheit,
    "mV under V": _scaled("voltage", _one_of(1000.0)),
    "gain of the voltage": _scaled("voltage", _between(1.05, 1.3)),
} | KINDS_OF_COLUMNS  # fmt: skip
