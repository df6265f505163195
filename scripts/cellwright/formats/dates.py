"""Texts of dates and clocks as seconds.

A column of them is read as the blocks of its file come: the seconds are kept, the texts are not.
"""

import re
from collections.abc import Sequence

import numpy as np

from cellwright.formats.pieces import any_where

FRACTION = r"(?P<fraction>\.\d+)?"
# Seconds and their fraction as one.
CLOCK = (
    r"^\s*(?:(?P<day>\d+)\s*d\s+)?"
    r"(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+(?:\.\d+)?)\s*$"
)
CLOCKED = re.compile(r"^\s*(?:\d+\s*d\s+)?\d+:\d+:\d")
# Parts of a date, as `strptime` calls them; %p is a letter of its own.
PARTS = {
    "%Y": r"(?P<year>\d{4})",
    "%y": r"(?P<year>\d{2})",
    "%m": r"(?P<month>\d{1,2})",
    "%d": r"(?P<day>\d{1,2})",
    "%H": r"(?P<hour>\d{1,2})",
    "%I": r"(?P<hour>\d{1,2})",
    "%M": r"(?P<minute>\d{1,2})",
    "%S": r"(?P<second>\d{1,2})",
}
LIMITS = {"month": (1, 12), "hour": (0, 23), "minute": (0, 59), "second": (0, 60)}
ROWS = 1 << 16  # that are taken at once: a text of 20 letters is many numbers
DAY_SECOND, POINT, DIGITS = 86400, ord("."), b"0123456789"
MOST_PACES = 10  # intervals between rows that may lie over midnight; a clock begun anew is off more
ZONED = "ISO 8601"  # with a letter T and, mostly, a zone: told by pyarrow, not by places


class _InPieces:
    """A column of texts that is read piece by piece, of blocks that are shorter."""

    def __init__(self):
        self.blocks, self.rows = [], 0

    def add(self, block):
        """Take a block of the column (pyarrow strings)."""
        self.blocks.append(block)
        self.rows += len(block)
        if self.rows >= ROWS:
            self.read_blocks()

    def read_blocks(self):
        """Read the blocks that wait."""
        import pyarrow as pa

        texts = pa.concat_arrays(self.blocks) if self.blocks else []
        self.blocks, self.rows = [], 0
        for first in range(0, len(texts), ROWS):
            self.read(texts[first : first + ROWS])


class Dates(_InPieces):
    """A column of dates that is read piece by piece: its seconds in the formats that fit so far."""

    def __init__(self, formats: Sequence[str]):
        super().__init__()
        self.seconds = {form: [] for form in formats}

    def read(self, texts):
        """Read a piece of the column."""
        for form, known in [*self.seconds.items()]:
            # Most formats fail at the first text.
            fits = known or _dates(texts[:1], form) is not None
            seconds = _dates(texts, form) if fits else None
            if seconds is None:
                del self.seconds[form]
            else:
                known.append(seconds)

    def all(self):
        """The column itself, with its seconds since 1970 by format."""
        self.read_blocks()
        self.seconds = {form: _joined(found) for form, found in self.seconds.items()}
        return self


class Clocks(_InPieces):
    """A column of clocks that is read piece by piece: hh:mm:ss.mmm, beyond 24 h, or 2d hh:mm:ss."""

    def __init__(self):
        super().__init__()
        self.seconds = []

    def read(self, texts):
        """Read a piece of the column."""
        self.seconds.append(_clocks(texts))

    def all(self):
        """Seconds (n,), NaN where a text is no clock."""
        self.read_blocks()
        return _joined(self.seconds)


def _joined(blocks):
    return np.concatenate(blocks) if blocks else np.empty(0)


class Times:
    """A column of clocks or of dates that is read block by block.

    example : its first text. clock : (n,) seconds as of `Clocks`, or None. dates : `Dates`.
    """

    def __init__(self, formats: Sequence[str]):
        self.example, self.clock, self.dates = None, Clocks(), Dates(formats)

    def add(self, block):
        """Read a block of the column (pyarrow strings)."""
        if self.example is None:
            self.example = next(filter(None, block[:20].to_pylist()), "")
        if CLOCKED.match(self.example):
            self.clock.add(block)
        else:
            self.dates.add(block)

    def all(self):
        """The column itself."""
        is_clock = CLOCKED.match(self.example or "")
        self.clock, self.dates = self.clock.all() if is_clock else None, self.dates.all()
        return self


def unix_time_second(texts, formats: Sequence[str]) -> np.ndarray | None:
    """Seconds since 1970 of date texts (pyarrow strings), as `date_readings` reads them first."""
    dates = Dates(formats)
    dates.add(texts)
    return next(iter(date_readings(dates.all()).values()), None)


def date_readings(dates: Dates, elapsed_second=np.nan) -> dict[str, np.ndarray]:
    """Seconds since 1970 of a column of dates by format: the first that fits all texts.

    The instrument's local time is taken as it stands: only differences are used. Empty where no
    format fits, for a date that cannot be read is no date. 3/11 and 4/11 are two days in November
    or two months: where the clock says how long the record is [s], the format fits best that says
    so too. Where days and months can still be exchanged, the second format is that way round.
    """
    fitting, fits = {}, []
    for form, seconds in dates.seconds.items():
        if fits and form != _exchanged(fits[0]):
            continue
        fitting[form] = seconds
        if not abs(np.ptp(seconds) - elapsed_second) > DAY_SECOND:
            fits.append(form)
    if not fits:
        fits = sorted(fitting, key=lambda f: abs(np.ptp(fitting[f]) - elapsed_second))[:1]
    return {form: fitting[form] for form in fits}


def _exchanged(form):
    """The format with day and month exchanged."""
    return form.translate(str.maketrans("md", "dm"))


def over_midnight(clock: np.ndarray) -> np.ndarray:
    """Seconds of a clock of the day (n,), counted on where it begins anew at midnight.

    It does where it falls from just before 24 h to just after 0 h; other falls stay as they are.
    """
    if not any_where(lambda seconds: np.diff(seconds) < 0, clock, beside=1):
        return clock
    interval = np.diff(clock)
    pace = np.median(interval[interval > 0]) if np.any(interval > 0) else 0.0
    wraps = (interval < 0) & (interval + DAY_SECOND <= MOST_PACES * pace)
    if np.nanmax(clock, initial=0.0) >= DAY_SECOND or not wraps.any():
        return clock
    return clock + DAY_SECOND * np.concatenate([[0], np.cumsum(wraps)])


def _zoned(texts):
    """Seconds since 1970 of a block of dates as ISO 8601 has them, with a zone or without."""
    import pyarrow as pa
    import pyarrow.compute as pc

    for kind in (pa.timestamp("us", tz="UTC"), pa.timestamp("us")):
        try:
            return pc.cast(texts, kind).cast(pa.int64()).to_numpy(zero_copy_only=False) / 1e6
        except pa.ArrowInvalid:
            continue
    return None


def _dates(texts, form):
    """Seconds since 1970 of a block of dates in one format, None where one does not fit it."""
    if form == ZONED:
        return _zoned(texts)
    pattern = r"\s*" + re.escape(form) + FRACTION + r"\s*"
    for part, written in PARTS.items():
        pattern = pattern.replace(re.escape(part), written)
    # Names of months and of halves of the day are letters: only `strptime` knows them.
    letters = "%p" in form or "%b" in form
    numbers = None if letters else _by_places(texts, re.compile(pattern))
    if numbers is None:
        return _by_strptime(texts, form)
    seconds = _since_1970(numbers, form)
    return seconds if seconds is None else np.broadcast_to(seconds, len(texts))


def _since_1970(numbers, form):
    # What a format does not write is none: a date of minutes has no seconds.
    numbers = dict.fromkeys(("hour", "minute", "second"), np.int64(0)) | numbers
    if any(np.any((numbers[k] < a) | (numbers[k] > b)) for k, (a, b) in LIMITS.items()):
        return None
    year = numbers["year"] + (np.where(numbers["year"] < 69, 2000, 1900) if "%y" in form else 0)
    month = np.asarray(12 * (year - 1970) + numbers["month"] - 1).astype("datetime64[M]")
    days, last = (m.astype("datetime64[D]").astype(np.int64) for m in (month, month + 1))
    if np.any((numbers["day"] < 1) | (numbers["day"] > last - days)):
        return None
    seconds = (days + numbers["day"] - 1) * DAY_SECOND + numbers["hour"] * 3600
    seconds += numbers["minute"] * 60 + numbers["second"]
    return np.asarray(seconds, float) + numbers["fraction"]


def _by_places(texts, pattern):
    """Numbers of a pattern's groups, each in the same places of all texts of one length.

    Ten times as fast as a pattern on each text. None where a text differs from the first of its
    length by more than its digits, or does not fit the pattern.
    """
    if texts.null_count or not len(texts):
        return None
    _, ends, data = texts.buffers()
    ends = np.frombuffer(ends, np.int32)[texts.offset : texts.offset + len(texts) + 1]
    lengths = np.diff(ends)
    found = {}
    for length in np.unique(lengths):
        rows = np.flatnonzero(lengths == length)
        if not length:
            return None
        letters = np.frombuffer(data, np.uint8)
        if len(rows) == len(lengths):
            return _of_one_length(letters[ends[0] : ends[-1]].reshape(len(rows), length), pattern)
        numbers = _of_one_length(letters[ends[rows][:, None] + np.arange(length)], pattern)
        if numbers is None:
            return None
        for name, values in numbers.items():
            kind = np.asarray(values).dtype
            found.setdefault(name, np.zeros(len(lengths), kind))[rows] = values
    return found


def _of_one_length(written, pattern):
    """Numbers of texts (n, length) of bytes that differ by their digits alone.

    A number is one for all, or one of each (n,).
    """
    first = bytes(written[0])
    parts = pattern.fullmatch(first.decode("latin-1"))
    if not parts:
        return None
    places = np.ascontiguousarray(written.T)
    varies = np.flatnonzero([not np.all(shown == shown[0]) for shown in places])
    # Bytes below that of 0 turn over to large numbers.
    digits = {place: places[place] - np.uint8(48) for place in varies}
    if any(first[k] not in DIGITS or d.max() > 9 for k, d in digits.items()):
        return None
    found = {}
    for name in parts.groupdict():
        begin, end = parts.span(name)
        number, decimals = np.int64(0), -1
        if end - begin > 15:  # digits that a floating-point number may not hold
            return None
        for place in range(begin, end):
            point = first[place] == POINT
            if not point:
                number = 10 * number + digits.get(place, first[place] - 48)
            decimals += point or decimals >= 0
        # A whole number over a power of ten is rounded once, as the text itself would be.
        found[name] = number / 10.0**decimals if decimals > 0 else number
    return found


def _by_strptime(texts, form):
    import pyarrow as pa
    import pyarrow.compute as pc

    texts = pc.utf8_trim_whitespace(texts)
    fraction = pc.extract_regex(texts, r"(?P<part>\.\d+)$")
    whole = pc.replace_substring_regex(texts, r"\.\d+$", "")
    try:
        seconds = pc.strptime(whole, format=form, unit="s").cast(pa.int64())
    except pa.ArrowInvalid:
        return None
    part = pc.fill_null(pc.cast(pc.struct_field(fraction, "part"), pa.float64()), 0.0)
    return seconds.to_numpy(zero_copy_only=False).astype(float) + part.to_numpy()


def _clocks(texts):
    """Seconds of a block of clock texts."""
    import pyarrow as pa
    import pyarrow.compute as pc

    numbers = _by_places(texts, re.compile(CLOCK))
    if numbers is not None:
        whole = numbers["day"] * 86400 + numbers["hour"] * 3600 + numbers["minute"] * 60
        return np.broadcast_to(np.asarray(whole + numbers["second"], float), len(texts))
    parts = pc.extract_regex(texts, CLOCK)
    day, hour, minute, second = (
        pc.cast(_or_zero(pc.struct_field(parts, name)), pa.float64()).to_numpy(zero_copy_only=False)
        for name in ("day", "hour", "minute", "second")
    )
    return day * 86400 + hour * 3600 + minute * 60 + second


def _or_zero(texts):
    """Texts with "0" in place of what a pattern found blank."""
    import pyarrow.compute as pc

    return pc.if_else(pc.equal(texts, ""), "0", texts)
