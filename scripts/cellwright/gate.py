"""The one gate for bytes of others: which files are opened, how far they unpack, how wide they are.

A file may be a trap or a mistake, and nothing tells which: a pipe that never ends, a few megabytes
that unpack to all the memory there is, one line without an end. Each is refused in a sentence, so
that it costs its own test and no other. `contents` opens files, `joined` counts what is unpacked,
`refuse_wide` looks at text; all readers stand behind them.
"""

import io
import os
import re
import stat

from cellwright.refusal import Refusal
from cellwright.settings import Files

MEGABYTE = 1e6  # byte
LARGE = 1 << 26  # byte from which on a file, as it lies there, is better read from the disk
CHUNK = 1 << 20  # byte that are read or unpacked at a time
# Readings of instruments shrink to a tenth, counters and constant columns to a twentieth (the most
# of 900 measured files); gzip can do a thousandth, Zstandard and Parquet a hundred-thousandth.
MOST_TIMES = 100
UNNOTICED = 32 * MEGABYTE  # up to here no job's memory notices what a file unpacks to
# A cell's record has tens of columns, that of a pack of a thousand cells some thousands.
MOST_COLUMNS = 4096
LONGEST_LINE = 64 * MOST_COLUMNS  # byte, of labels as long as they come
# What means something where names of files are written: Snakemake's wildcards and its variables of
# paths, and ends of lines.
UNFIT = {"[{}]": "a brace", "[\n\r]": "a line break", "\0": "a NUL"}
UNFIT |= {"<[a-z][a-z0-9_]*>": "a word between < and >"}
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe (FIFO)"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def obstacle(path, within=None, largest_megabyte=None) -> str:
    """Why the gate does not open a file, as what follows its name; "" where it does.

    Parameters
    ----------
    path : of the file, from `within`, else from the working folder.
    within : folder in which it must lie, links followed (a campaign reads nothing outside itself);
        None: anywhere, as on a user's own word.
    largest_megabyte : length beyond which it is too long [MB]; None: the default of
        `settings.Files`.
    """
    name = os.fspath(path)
    path = _place(path, within)
    unfit = next((what for mark, what in UNFIT.items() if re.search(mark, name)), None)
    if unfit and (within is not None or "\0" in name):
        return f"has {unfit} in its name; rename it"
    try:
        about = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return "there is no such file" + (" in the campaign" if within is not None else "")
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    if not stat.S_ISREG(about.st_mode):
        kind = next((what for holds, what in KINDS if holds(about.st_mode)), "none")
        return f"is {kind}, wanted a file"
    if within is not None and not _lies_in(path, within):
        return "leads out of the campaign by a link; copy the file into it"
    largest = _largest(largest_megabyte)
    if about.st_size > largest * MEGABYTE:
        return f"is {about.st_size / MEGABYTE:,.2f} MB long, {_more_than(largest)}"
    return ""


def _place(path, within):
    return path if within is None else os.path.join(within, path)


def _lies_in(path, folder):
    inside = os.path.join(os.path.realpath(folder), "")
    return os.path.realpath(path).startswith(inside)


def contents(path, *, within=None, largest_megabyte=None) -> bytes:
    """The bytes of a regular file.

    Parameters
    ----------
    path, within, largest_megabyte : as of `obstacle`.

    Raises
    ------
    Refusal
        There is an `obstacle`, or the file may not be read. The message names it.
    OSError
        The disk fails, which says nothing of the file.
    """
    content = content_at(path, within=within, largest_megabyte=largest_megabyte)
    if isinstance(content, bytes):
        return content
    with content:
        return content.read()


def content_at(path, *, within=None, largest_megabyte=None, opener=io.FileIO):
    """The bytes of a regular file; of a large one the open file, to be read in blocks.

    Parameters
    ----------
    path, within, largest_megabyte : as of `obstacle`. opener : class of the open file.

    Raises
    ------
    Refusal
        As of `contents`.
    OSError
        The disk fails, which says nothing of the file.
    """
    reason = obstacle(path, within, largest_megabyte)
    if reason:
        raise Refusal(f"{path}: {reason}")
    # Without waiting: a pipe may have taken the file's place since the look at it.
    waits_not = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        file = opener(
            _place(path, within),
            "rb",
            opener=lambda name, _: os.open(name, os.O_RDONLY | waits_not),
        )
        about = os.fstat(file.fileno())
        if not stat.S_ISREG(about.st_mode):
            file.close()
            raise Refusal(f"{path}: is no file any more")
        if about.st_size > LARGE:
            return io.BufferedReader(file)
        with io.BufferedReader(file) as whole:
            # No more than was found: a file that is being written to may have no end.
            return whole.read(about.st_size)
    except PermissionError as error:
        raise Refusal(f"{path}: cannot be read: {error.strerror}") from None


def joined(chunks, packed_byte: int, largest_megabyte=None) -> bytes:
    """What a file unpacks to, from pieces that are asked for as long as there may be more.

    Parameters
    ----------
    chunks : iterable of bytes, each made when it is asked for. packed_byte : length of the file.
    largest_megabyte : as of `obstacle`.

    Raises
    ------
    Refusal
        As `refuse_unpacked`, at the first piece that is too much.
    """
    kept, total = [], 0
    for chunk in chunks:
        total += len(chunk)
        refuse_unpacked(total, packed_byte, largest_megabyte)
        kept.append(chunk)
    return b"".join(kept)


def refuse_unpacked(unpacked_byte: int, packed_byte: int, largest_megabyte=None):
    """Refuse more than the largest length, or than readings can have been packed from."""
    if unpacked_byte > max(UNNOTICED, MOST_TIMES * packed_byte):
        raise Refusal(
            f"unpacks to more than {MOST_TIMES} times its {packed_byte / MEGABYTE:.3g} MB, which "
            "no record of readings does; it is not read further"
        )
    largest = _largest(largest_megabyte)
    if unpacked_byte > largest * MEGABYTE:
        raise Refusal(f"unpacks to {_more_than(largest)}")


def _largest(megabyte):
    return Files().largest_megabyte if megabyte is None else megabyte


def _more_than(megabyte):
    return f"more than the {megabyte:g} MB that the setting files.largest_megabyte allows"


def refuse_wide(text: bytes):
    """Refuse a text with a line that no table of readings has.

    From the last line end within reach to the next one: only windows without any are looked
    through, so that it takes no time.
    """
    start = 0
    while len(text) - start > LONGEST_LINE:
        end = text.rfind(b"\n", start, start + LONGEST_LINE)
        if end < 0:
            number = text.count(b"\n", 0, start) + 1
            raise Refusal(
                f"line {number} is longer than {LONGEST_LINE} bytes, as none of a table is"
            )
        start = end + 1


def refuse_columns(number: int):
    """Refuse a table of more columns than the record of any cell or pack has."""
    if number > MOST_COLUMNS:
        raise Refusal(f"the table has {number} columns, wanted {MOST_COLUMNS} at most")
