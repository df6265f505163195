"""Text in the cells of a CSV table: none that a spreadsheet would run, each read back as it was.

What begins with one of `= + - @` is a formula to a spreadsheet, and may call programs: a note, the
name of a file, or a reason that names one. An apostrophe before it makes it the text that it is.
"""

import re

# And what some programs take for the end of a cell, a tab and line ends.
FORMULA = re.compile(r"'*[=+\-@\t\r\n]")
GUARD = "'"


def guarded(text: str) -> str:
    """Text of a cell, with an apostrophe before what may be a formula; numbers stay as they are."""
    return GUARD + text if FORMULA.match(text) and not _is_number(text) else text


def as_written(cell: str) -> str:
    """The text that `guarded` made this cell of."""
    return cell[1:] if cell.startswith(GUARD) and FORMULA.match(cell) else cell


def frame_as_written(frame):
    """A DataFrame of a CSV file with every text as it was before it was guarded."""
    for name in frame.columns[[str(kind) in ("str", "object") for kind in frame.dtypes]]:
        texts = frame[name].map(lambda cell: isinstance(cell, str) and cell.startswith(GUARD))
        if texts.any():
            frame.loc[texts, name] = frame.loc[texts, name].map(as_written)
    return frame


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True
