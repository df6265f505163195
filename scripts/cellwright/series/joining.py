"""The readings of one test as one series: files joined, clock and counter continued, sign found.

Cellwright counts charge positive, cyclers disagree: what a file does not tell, its voltage does
(`sign`).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cellwright.formats import SIGN_RULE, Reading, read
from cellwright.formats.fields import ENERGY, NET, SERIES, counted_share
from cellwright.formats.pieces import (
    any_where,
    column_of,
    pieces,
    rows_where,
    step_at,
    sum_of,
    summed,
)
from cellwright.messages import said_of
from cellwright.refusal import Refusal
from cellwright.result import frame
from cellwright.series.cleaning import CLEAN
from cellwright.series.doubts import Doubt, against_counter
from cellwright.series.messages import say
from cellwright.series.repeated import repeated_rows
from cellwright.series.sign import MAGNITUDES, NO_CURRENT, OPPOSED, Sign, current_sign, is_reading
from cellwright.series.steps import silent_before


class Assembled(NamedTuple):
    """The files of one test as one series, and notes on how they were put together."""

    columns: dict[str, np.ndarray]  # with file_index, the file that a row came from
    notes: tuple[str, ...]


def join(series: Sequence[Mapping[str, np.ndarray]]) -> Assembled:
    """Join the files of one test, given in time order.

    1. Where both files carry absolute time, the pause between them is the real one.
    2. Else, where the second clock goes on from the first, it is kept.
    3. Else the second file begins one sampling interval after the first ends, and a note says so.

    series : sequence of mappings of arrays
        test_time_second [s], current_ampere [A], voltage_volt [V] and more; a column that one file
        lacks is NaN there.

    Returns Assembled. Raises Refusal: by their date stamps, a file begins before the one before it
    ends.
    """
    names = list(dict.fromkeys(name for columns in series for name in columns))
    series, notes = _without_repeats(series)
    first, *others = [_with_steady_counter(columns) for columns in series]
    parts = [first]
    for number, following in enumerate(others, start=2):
        part, note = _continued(parts[-1], following, number)
        parts.append(part)
        notes.append(note)
    sizes = [part["test_time_second"].size for part in parts]
    joined = first
    if others or len(names) > len(first):
        joined = {name: _joined(name, parts, sizes) for name in names}
        if "doubt" in joined:  # of a file without one there is none
            joined["doubt"] = np.nan_to_num(joined["doubt"]).astype(np.int16)
    joined["file_index"] = np.repeat(np.arange(len(parts)), sizes)
    return Assembled(joined, tuple(notes))


def of_labels(table) -> Assembled:
    """A DataFrame, or a mapping of columns, with labels as a csv has them, read as that would be.

    Raises Refusal as `formats.read` and `assemble`.
    """
    return assemble([read(csv_of(table), name="the table")])


def csv_of(table) -> bytes:
    """A DataFrame, with its index where that has a name, or a mapping of columns as a csv."""
    whole = table.to_pandas() if hasattr(table, "to_pandas") else table  # of polars, of Arrow
    if isinstance(table, Mapping):
        whole = frame({name: np.asarray(values) for name, values in table.items()})
    return whole.to_csv(index=any(name is not None for name in whole.index.names)).encode()


def _joined(name, parts, sizes):
    """A column of all files (n,), NaN in the rows of those that lack it."""
    known = [
        p[name] if name in p else np.full(k, np.nan) for p, k in zip(parts, sizes, strict=True)
    ]
    return np.concatenate(known)


def _without_repeats(series):
    """Files without rows that a file before holds too, by their own clocks, and notes.

    An export made later holds what was exported before: the same readings, which count once.
    """
    kept, notes = {1: dict(series[0])}, []
    for number, columns in enumerate(series[1:], start=2):
        for earlier, before in list(kept.items()):
            if repeated_rows(before, columns).all():
                notes.append(f"file {number} holds all rows of file {earlier}, which is left out")
                del kept[earlier]
                continue
            seen = repeated_rows(columns, before)
            if seen.any():
                notes.append(
                    f"{seen.sum()} rows of file {number} stand in file {earlier}: left out"
                )
                columns = {name: values[~seen] for name, values in columns.items()}
        if len(columns["test_time_second"]):
            kept[number] = dict(columns)
    return list(kept.values()), notes


def _continued(before: Mapping, after: Mapping, number: int) -> tuple[dict, str]:
    """Columns of the next file on the clock and counter of the file before, and a note."""
    shift, note = _clock_shift(before, after, number)
    part = dict(after)
    part["test_time_second"] = after["test_time_second"] + shift
    if NET in before and NET in after:
        # A counter that restarted goes on from the old level.
        goes_on = abs(after[NET][0] - before[NET][-1]) <= abs(after[NET][0])
        part[NET] = after[NET] + (0.0 if goes_on else float(before[NET][-1]))
    return part, note


def _clock_shift(before: Mapping, after: Mapping, number: int) -> tuple[float, str]:
    """Time to add to the clock of a file [s], and a note on where it comes from."""
    end, start = before["test_time_second"][-1], after["test_time_second"][0]
    steps = np.diff(after["test_time_second"][:20])
    interval = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    if "unix_time_second" in before and "unix_time_second" in after:
        pause = after["unix_time_second"][0] - before["unix_time_second"][-1]
        # ASSUME: Local dates that go back by less than an hour, and not behind the beginning of
        # the file before, do so where summer time ends, or another clock wrote them.
        if before["unix_time_second"][0] < after["unix_time_second"][0] and -HOUR - 2 <= pause < -2:
            overlap = (
                f"by its dates file {number} begins {-pause:g} s before file {number - 1} ends"
            )
            if _summer_time_ends(before["unix_time_second"][-1]):
                shift = end + max(pause + HOUR, interval) - start
                return shift, (
                    f"{overlap}: taken as {pause + HOUR:g} s after it, the clock being set back by "
                    "an hour"
                )
            return end + interval - start, (
                f"{overlap}: two clocks wrote them. File {number} is joined directly behind file "
                f"{number - 1}; the pause between them is not known"
            )
        if pause < -2.0:  # date stamps of whole seconds may be wrong by one at either end
            raise Refusal(
                f"file {number} begins {-pause:g} s before file {number - 1} ends, by their dates; "
                "files must be given in time order"
            )
        shift = end + max(pause, interval) - start
        return shift, say("files.by_dates", number=number, second=pause, before=number - 1)
    # A clock that had started anew would show about one sampling interval in its first row.
    if start > end and start > 2 * interval:
        about = {"number": number, "second": start - end, "before": number - 1}
        return 0.0, say("files.clock_goes_on", **about)
    # ASSUME: A file without dates whose clock starts anew follows the one before at once.
    return end + interval - start, f"file {number} put behind file {number - 1}: pause not known"


def _summer_time_ends(unix_second) -> bool:
    """Whether summer time may end at a local date: a Sunday night in spring or autumn."""
    day, second = divmod(int(unix_second), 86400)
    month = int((np.datetime64(day, "D").astype("datetime64[M]").astype(int)) % 12) + 1
    # 1 January 1970 was a Thursday.
    return (day + 3) % 7 == 6 and second <= 4 * HOUR and month in (3, 4, 9, 10, 11)


def _with_steady_counter(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns with an ampere-hour counter without the resets that the instrument made in the file.

    A reset jumps by far more than the current could have moved, and lands near zero.
    """
    if NET not in columns:
        return dict(columns)
    time, current, counter = (columns[name] for name in (*SERIES[:2], NET))
    least = 1e-3 * max(np.nanmax(counter), -np.nanmin(counter))
    far = rows_where(lambda c: np.abs(np.diff(c)) > 5 * least, counter, beside=1) + 1
    interval = np.abs(time[far] - time[far - 1])
    size = np.maximum(np.abs(current[far]), np.abs(current[far - 1]))
    possible = 2 * (size * interval) / 3600 + least
    moved = np.abs(step_at(counter, far - 1))
    reset = far[(moved > 5 * possible) & (np.abs(counter[far]) < possible)]
    steady = np.zeros(len(counter))
    moved, last = steady[1:], None
    for part in pieces(len(counter), beside=1):
        moved[part.start : part.stop - 1] = np.diff(counter[part])
    moved[reset - 1] = counter[reset]
    for part in pieces(len(moved)):
        last = summed(moved[part], last)
    steady += counter[0]
    return {**columns, NET: steady}


HOUR = 3600.0  # s
CONVENTIONS = {"charge_positive": 1, "discharge_positive": -1}


def charge_positive(
    columns: Mapping[str, np.ndarray], *, stated: str | None = None, default: str | None = None
) -> Assembled:
    """Turn the current of a series, and its branches and counter, positive on charge.

    columns : mapping of arrays
        test_time_second [s], current_ampere [A], voltage_volt [V]; branch_…_current_ampere [A] and
        net_capacity_ampere_hour [Ah] where there are any.
    stated : {None, "charge_positive", "discharge_positive"}
        What the sheet says of the file.
    default : {None, "charge_positive", "discharge_positive"}
        What the file's format says; it serves where the data cannot tell.

    Returns Assembled, with a note where something is worth saying of the sign. Raises Refusal: the
    data clearly contradict what is stated, or show magnitudes only; or nothing is stated and
    nothing can tell.
    """
    shown = current_sign(*(columns[name] for name in SERIES))
    sign, note = _decided(shown, stated, default)
    turned = _turned(columns, sign)
    if not shown.sign and shown.evidence == 0.0 and shown.reason.startswith(OPPOSED):
        said = turned.get("doubt", np.zeros(len(turned["current_ampere"]), np.int16))
        turned["doubt"] = said | np.int16(Doubt.SIGN)
    return Assembled(turned, (note,) * bool(note))


def _decided(shown: Sign, stated: str | None, default: str | None) -> tuple[int, str]:
    """Sign to use (+1 or -1), and a note where it is not what the data and the sheet both say."""
    rule = stated or default
    if shown.reason == NO_CURRENT:
        return CONVENTIONS[rule or "charge_positive"], f"{NO_CURRENT}: its sign does not matter"
    if shown.reason == MAGNITUDES or not (shown.sign or rule):
        raise Refusal(
            f"the data cannot tell the sign of the current: {shown.reason}; "
            f"state current_sign ({' or '.join(CONVENTIONS)}) of a signed current"
        )
    if not shown.sign:
        return CONVENTIONS[rule], f"current taken as {rule}: the data cannot tell ({shown.reason})"
    direction = "charge_positive" if shown.sign > 0 else "discharge_positive"
    if stated and stated != direction:
        raise Refusal(
            f"current_sign says {stated}, the voltage shows {direction} ({shown.reason}); "
            "correct the sheet, or leave it blank"
        )
    against = f"current is {direction} by its voltage, against the format's rule {default}"
    return shown.sign, "" if stated or default in (None, direction) else against


def _turned(columns: Mapping[str, np.ndarray], sign: int) -> dict[str, np.ndarray]:
    """Columns with all currents times the sign, and the counter rising with charge."""
    turned = dict(columns)
    for name in columns:
        if name.endswith("current_ampere") and sign < 0:
            turned[name] = columns[name] * sign
    if NET in columns and counted_share(turned) < 0:
        turned[NET] = columns[NET] * -1
    return turned


def assemble(readings: Sequence[Reading], *, stated_sign: str | None = None) -> Assembled:
    """Join the readings of one test and turn the current positive on charge.

    readings : sequence of Reading, in time order
    stated_sign : {None, "charge_positive", "discharge_positive"}
        What the sheet says of the files; blank or None: found from the data.

    Returns Assembled with columns test_time_second [s], current_ampere [A, + charge], voltage_volt
    [V], file_index and what else the files hold. Raises Refusal: a reading is no series, the files
    are out of order, or the sign cannot be known.
    """
    for number, reading in enumerate(readings, start=1):
        if reading.kind != "series":
            raise Refusal(f"file {number} holds {reading.kind}, a series is wanted")
    columns_of_files = [_held_against_energy(reading.columns) for reading in readings]
    said = [note for k, r in enumerate(readings) for note in _notes(r, k, len(readings))]
    if any(reading.sign for reading in readings):
        signs = _own_signs(readings, stated_sign)
        files = [
            _turned(columns, sign) for columns, sign in zip(columns_of_files, signs, strict=True)
        ]
        joined = join(files)
        return Assembled(joined.columns, (*said, *joined.notes, *_against_voltage(joined.columns)))
    if not stated_sign:
        _refuse_unlike([current_sign(*(r.columns[n] for n in SERIES)).sign for r in readings])
    joined = join(columns_of_files)
    rules = {SIGN_RULE.get(reading.instrument) for reading in readings}
    default = rules.pop() if len(rules) == 1 else None
    signed = charge_positive(joined.columns, stated=stated_sign or None, default=default)
    return Assembled(signed.columns, (*said, *joined.notes, *signed.notes))


def _held_against_energy(columns):
    """Columns of a file without the energy that its instrument counted, and with what it says.

    It is the product of both channels: a wrong voltage shows in it too, which no charge tells.
    """
    energy = columns.get(ENERGY)
    if energy is None:
        return columns
    kept = {name: values for name, values in columns.items() if name != ENERGY}
    time, current, voltage = (columns[name] for name in SERIES)
    good = is_reading(time, current, voltage)
    good &= column_of(np.isfinite, energy, dtype=bool)
    good = slice(None) if good.all() else np.flatnonzero(good)
    time, energy = time[good], energy[good]
    if len(time) < 2 or not any_where(np.diff, energy, beside=1):
        return kept
    power = column_of(np.multiply, current[good], voltage[good])
    # Whichever sign the file gives its current, energy and charge run together.
    if sum_of(_together, time, power, energy, beside=1) < 0:
        np.negative(power, out=power)
    apart = np.zeros(len(time), bool)
    apart[1 + rows_where(lambda t: np.diff(t) < 0, time, beside=1)] = True
    apart[silent_before(time, CLEAN.gap_second)] = True
    found = np.zeros(len(current), np.int16)
    found[good] = against_counter(time, power, energy, apart) * np.int16(Doubt.ENERGY)
    return kept | {"doubt": found} if found.any() else kept


def _together(time, power, energy):
    """Above zero where the energy rises with the power, below where it falls."""
    return (power[1:] + power[:-1]) * np.diff(time) * np.diff(energy)


def _notes(reading, index, files):
    """What the reader left out of a file, with its number where a test has several."""
    return [said_of(f"file {index + 1}", note) if files > 1 else note for note in reading.notes]


def _own_signs(readings, stated):
    """Sign of each file as its own counters or letters tell it; of a file without, as the others.

    These are exact: the voltage, which follows the current with a delay or is held, never overrules
    them, nor does the sheet.
    """
    own = [reading.sign for reading in readings]
    for number, sign in enumerate(own, start=1):
        if stated and sign and CONVENTIONS[stated] != sign:
            raise Refusal(
                f"current_sign says {stated}, the counters or step letters of file {number} show "
                f"{_convention(sign)}; correct the sheet, or leave it blank"
            )
    told = {sign for sign in own if sign}
    if len(told) > 1 and 0 in own and not stated:
        raise Refusal(
            f"file {own.index(0) + 1} does not tell the sign of its current, and those of the "
            "other files differ; state current_sign"
        )
    rest = CONVENTIONS[stated] if stated else told.pop()
    return [sign or rest for sign in own]


def _convention(sign):
    return next(name for name, of_name in CONVENTIONS.items() if of_name == sign)


def _against_voltage(columns):
    """A note where the voltage speaks clearly against a sign that counters or letters tell."""
    shown = current_sign(*(columns[name] for name in SERIES))
    if shown.sign >= 0:
        return ()
    return (f"the voltage speaks against the sign of the counters ({shown.reason})",)


def _refuse_unlike(signs):
    """Refuse files of one test whose voltages show currents of opposite signs."""
    told = [(number, sign) for number, sign in enumerate(signs, start=1) if sign]
    for number, sign in told:
        if sign != told[0][1]:
            raise Refusal(
                f"file {number} shows {_convention(sign)} by its voltage, file {told[0][0]} "
                f"{_convention(told[0][1])}: give files of one sign, or state current_sign"
            )
