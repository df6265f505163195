"""Date texts of instruments → seconds since 1970, and clock texts → seconds."""

from collections.abc import Sequence

import numpy as np

CLOCK = r"^\s*(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+(?:\.\d+)?)\s*$"


def unix_time_second(texts, formats: Sequence[str]) -> np.ndarray | None:
    """Seconds since 1970 of date texts (a pyarrow string array) in the first format that fits all.

    The instrument's local time is taken as it stands: only differences are used. None where no
    format fits, for a date that cannot be read is no date.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    texts = pc.utf8_trim_whitespace(texts)
    fraction = pc.extract_regex(texts, r"(?P<part>\.\d+)$")
    whole = pc.replace_substring_regex(texts, r"\.\d+$", "")
    for form in formats:
        try:
            seconds = pc.strptime(whole, format=form, unit="s").cast(pa.int64())
        except pa.ArrowInvalid:
            continue
        part = pc.fill_null(pc.cast(pc.struct_field(fraction, "part"), pa.float64()), 0.0)
        return seconds.to_numpy(zero_copy_only=False).astype(float) + part.to_numpy()
    return None


def clock_second(texts) -> np.ndarray:
    """Seconds of clock texts hh:mm:ss.mmm, hours beyond 24; NaN where a text is none."""
    import pyarrow as pa
    import pyarrow.compute as pc

    parts = pc.extract_regex(texts, CLOCK)
    hour, minute, second = (
        pc.cast(pc.struct_field(parts, name), pa.float64()).to_numpy(zero_copy_only=False)
        for name in ("hour", "minute", "second")
    )
    return hour * 3600 + minute * 60 + second
