"""An instrument's file as columns with standard names and units.

The caller hands the bytes: nothing here opens a file. The sign of the current is the file's own;
series.joining turns it.
"""

import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright import gate
from cellwright.formats import (
    arbin,
    bare_spectrum,
    bdf,
    bitrode,
    column_map,
    columnar,
    digatron,
    labview,
    makers,
    matlab,
    outside,
    plett,
    sheets,
    text_table,
    thermometers,
    zahner,
)
from cellwright.formats.container import sight
from cellwright.formats.content import Content, content_of, head_of, whole_of, with_lines_changed
from cellwright.formats.fields import with_net_counter
from cellwright.formats.physics import checked_impedance, checked_series
from cellwright.formats.table import decoded, unread
from cellwright.formats.workbook import is_workbook, sheet_names
from cellwright.refusal import Refusal

TEXTS = (bdf, arbin, bitrode, digatron, labview, plett, bare_spectrum)
BINARIES = (zahner, matlab, sheets, outside.NewareBinary, outside.ArbinDatabase)
MODULES = {module.NAME: module for module in (*TEXTS, *BINARIES)}
TABLES = {form.name: form for form in makers.MAKERS}
READERS = (*MODULES, *TABLES, makers.GENERIC.name)
# Readers of texts of any length, which need not be in memory as a whole.
IN_BLOCKS = {module.NAME for module in (bdf, arbin, bitrode, digatron, plett)}
# What a format itself says of its current; where it says nothing, the data must tell.
POSITIVE_CHARGE = ("bdf", "neware", "neware_binary", "biologic", "novonix", "basytec")
SIGN_RULE = dict.fromkeys(POSITIVE_CHARGE, "charge_positive")
HEAD = 1 << 14
# Line ends the wrong way round, of which the second half then begins the next line.
TURNED_ENDS, AT_BEGIN = re.compile(rb"[^\r\n]*\n\r(?!\n)"), re.compile(rb"(?m)^\r")


class Reading(NamedTuple):
    """What one file holds."""

    columns: dict[str, np.ndarray]
    instrument: str  # the reader that understood it
    kind: str  # "series" or "impedance"
    notes: tuple[str, ...] = ()  # what was left out of the file, in sentences
    sign: int = 0  # 1 or -1: the current's, as the file's own counters or letters tell it
    dates: tuple[str, ...] = ()  # formats in which its dates can be read, the one taken first
    doubt: str = ""  # what the file says against its own numbers


def read(
    data,
    *,
    name: str,
    instrument: str | None = None,
    kind: str | None = None,
    largest_megabyte: float | None = None,
    date_format: str | None = None,
    columns=(),
) -> Reading:
    """Read one file of an instrument.

    Parameters
    ----------
    data : bytes, or an open binary file that can be sought in
        The file as it lies there; gzip and Zstandard are unpacked. A text in an open file is read
        in blocks: no more of it is held than the columns.
    name : str
        What messages call the file.
    instrument : str, optional
        Reader to use; blank or None: found from the content.
    kind : str, optional
        "series" or "impedance": which is wanted of a file that holds both; None: the one of more
        rows. A file that holds but one gives that.
    largest_megabyte : float, optional
        To which the file may unpack [MB]; None: the default of `settings.Files`.
    date_format : str, optional
        One of those that a `Reading` found: the one in which the file's dates are written.
    columns : sequence of str
        What the sheet says of labels, see `column_map`; the file is then read as a table of text.

    Returns
    -------
    Reading
        Series: test_time_second [s], current_ampere [A], voltage_volt [V] and what else there is.
        Impedance: frequency_hertz [Hz], impedance_real_ohm and impedance_imaginary_ohm [ohm].

    Raises
    ------
    Refusal
        The file is empty, cut off, of an instrument without a reader, holds text where a number
        belongs, lacks a column, unpacks to too much, or holds what no cell can have shown. The
        message starts with `name`.
    """
    try:
        content = _admitted(data, largest_megabyte)
        how = How(kind, date_format, tuple(columns))
        if is_workbook(head_of(content)):
            return _checked(*_of_workbook(whole_of(content), instrument, how))
        if columns:
            return _checked(*_read_stated(content, instrument, how))
        reader, more = _known(instrument) if instrument else detect(content), []
        if columnar.is_columnar(head_of(content)) and instrument != bdf.NAME:
            reader, content, more = _by_labels(reader, whole_of(content), largest_megabyte)
        found, notes, *rest = _read(reader, content, how)
        return _checked(reader, found, [*notes, *more], *rest)
    except Refusal as reason:
        raise Refusal(f"{name}: {reason}") from None


def read_together(files, **how) -> list[Reading]:
    """Read the files of one test: day first or month first is one decision for all of them.

    files : (name for messages, data) each, in time order. how : as of `read`.

    12/03 and 13/03 are two days in March: the format is taken that all files can have, in which
    they follow one another, and soonest.
    """
    readings = [read(data, name=name, **how) for name, data in files]
    dated = [reading.dates for reading in readings if reading.dates]
    common = [form for form in dated[0] if all(form in forms for forms in dated)] if dated else []
    first = {forms[0] for forms in dated}
    if len(dated) < 2 or not common or max(map(len, dated)) < 2 or first == {*common}:
        return readings
    ways = [
        readings
        if first == {form}
        else [
            read(data, name=name, date_format=form if reading.dates else None, **how)
            for (name, data), reading in zip(files, readings, strict=True)
        ]
        for form in common
    ]
    return min(ways, key=_apart)


def _apart(readings):
    """Whether files begin before the one before them ends, and seconds from first to last date."""
    dates = [r.columns["unix_time_second"] for r in readings if "unix_time_second" in r.columns]
    ends = [(np.nanmin(unix), np.nanmax(unix)) for unix in dates]
    behind = any(after[0] < before[1] - 2.0 for before, after in pairwise(ends))
    return behind, ends[-1][1] - ends[0][0]


def read_simulated(
    data: bytes, *, name: str, largest_megabyte: float | None = None
) -> dict[str, np.ndarray]:
    """A voltage that was simulated for a test, from a file in the Battery Data Format.

    Parameters
    ----------
    data : bytes
        The file as it lies there, CSV or Parquet; gzip and Zstandard are unpacked.
    name : str
        What messages call the file.
    largest_megabyte : float, optional
        As of `read`.

    Returns
    -------
    dict
        test_time_second [s], voltage_volt [V]; nothing of them is checked.

    Raises
    ------
    Refusal
        The file is damaged, or lacks one of the two columns. The message starts with `name`.
    """
    try:
        return bdf.read_simulated(_admitted(data, largest_megabyte))
    except Refusal as reason:
        raise Refusal(f"{name}: {reason}") from None


def _admitted(data, largest_megabyte):
    """The unpacked content, of a size and shape that readers can stand."""
    content = content_of(data, largest_megabyte)
    head = head_of(content)
    if head.startswith((bdf.PARQUET, bdf.ARROW)):
        bdf.refuse_large(whole_of(content), largest_megabyte)
    elif b"\0" not in head[:HEAD]:  # a text
        # A document may stand on one line, as one of a program to another does.
        if not bdf.JSON_BEGIN.match(head):
            gate.refuse_wide(head)
        if TURNED_ENDS.match(head):
            return with_lines_changed(content, 0, lambda lines: AT_BEGIN.sub(b"", lines))
    return content


def detect(data: bytes | Content) -> str:
    """Name of the reader that recognises the (unpacked) content.

    Raises
    ------
    Refusal
        None does, or more than one; the message says what the file looks like, where known.
    """
    data = head_of(data)
    head = data[:HEAD]
    text = decoded(head).replace("\r\n", "\n")
    found = [name for name, reader in MODULES.items() if reader.recognises(head)]
    found += [name for name, form in TABLES.items() if text_table.recognises(form, text)]
    if not found and text_table.recognises(makers.GENERIC, text):
        return makers.GENERIC.name
    if len(found) > 1:
        raise Refusal(f"could be of {' or '.join(found)}: say which as `instrument` in tests.tsv")
    if found:
        return found[0]
    if not data.strip():
        raise Refusal("the file is empty (nothing but blanks)")
    what = sight(data)
    looks = f"looks like {what}, which is not read yet" if what else "of no instrument known here"
    labels = text_table.labels_seen(text)
    named = (
        f", nor do its columns ({', '.join(map(repr, labels))}) name time, current and voltage, or "
        "frequency and impedance: say what they hold as `columns` in tests.tsv, "
        f"{column_map.EXAMPLE}, or rename them, such as Time (s), Current (A), Voltage (V)"
    )
    raise Refusal(f"{looks}{named if labels else ''}")


def _known(instrument: str) -> str:
    if instrument not in READERS:
        raise Refusal(f"no reader for instrument {instrument!r}; readers: {', '.join(READERS)}")
    return instrument


class How(NamedTuple):
    """What is known of a file before it is read, see `read`."""

    kind: str | None = None
    date_format: str | None = None
    columns: tuple[str, ...] = ()

    def form(self, name):
        """The format of a table of text of this name, with what is known of its dates and labels.

        Raises
        ------
        Refusal
            Labels are stated for a reader of no table of text.
        """
        form = TABLES.get(name, makers.GENERIC)
        if self.columns and name not in ("", None, form.name):
            raise Refusal(
                f"columns in tests.tsv serve tables of text alone, not instrument {name!r}; "
                "leave one of the two blank"
            )
        form = form._replace(dates=(self.date_format,)) if self.date_format else form
        return column_map.with_columns(form, self.columns) if self.columns else form


def _by_labels(reader: str, data: bytes, largest_megabyte: float | None):
    """Reader of Parquet or Arrow, its content, and notes: a csv where its labels are a table's.

    As it is where they are BDF's own, or nobody's.
    """
    labels, form = columnar.labels_of(data), makers.GENERIC
    if bdf.makes_table(labels) or not text_table.header_of(form, "\t".join(labels)):
        return reader, data, []
    kept = [label for label in dict.fromkeys(labels) if text_table.is_known(form, label)]
    return form.name, columnar.as_csv(data, kept, largest_megabyte), unread(labels, kept)


def _of_workbook(data: bytes, instrument: str | None, how: How):
    """Name of the reader of a workbook's table, its columns, notes, sign and formats of dates."""
    if how.columns:
        form = how.form(instrument)

        def stated(text):
            line = text_table.header_of(form, decoded(text[:HEAD]))
            return (form.name, line) if line else None

        return sheets.read(data, stated, lambda _, text: _read_stated(text, instrument, how)[1:])
    if any(name.startswith(arbin.CHANNEL_SHEET) for name in sheet_names(data)):
        return arbin.NAME, *arbin.read(data), 0

    def known(text):
        found = _of_sheet(text)
        return found if instrument in (None, "", sheets.NAME, *(found or ())[:1]) else None

    return sheets.read(data, known, lambda reader, text: _read(reader, text, how))


def _of_sheet(text: bytes) -> tuple[str, int] | None:
    """Name of the reader of a table in a sheet, and the number of the line of its labels."""
    head = decoded(text[:HEAD])
    for form in (*makers.MAKERS, makers.GENERIC):
        line = text_table.header_of(form, head)
        if line and (form is makers.GENERIC or text_table.recognises(form, head)):
            return form.name, line
    own = next((m.NAME for m in (bdf, arbin) if m.recognises(text[:HEAD])), None)
    return own and (own, 1)


def _read(reader: str, data: bytes | Content, how: How):
    """Columns of a file by the reader of a name, notes, sign by its letters, formats of dates."""
    if reader == sheets.NAME:
        raise Refusal("this is no Excel workbook (.xlsx): leave `instrument` in tests.tsv blank")
    if reader in MODULES:
        found = MODULES[reader].read(data if reader in IN_BLOCKS else whole_of(data))
        return (*found, 0) if isinstance(found, tuple) else (found, (), 0)
    return text_table.read(how.form(reader), data, how.kind)


def _read_stated(content, instrument, how: How):
    """Reader and what it reads of a table of text some of whose labels the sheet explains."""
    form = how.form(instrument)
    found, labels = text_table.read(form, content, how.kind), text_table.labels_of(form, content)
    missing = [x for x in column_map.labels_stated(how.columns) if x not in labels]
    if missing:
        raise Refusal(
            f"columns in tests.tsv names {', '.join(map(repr, missing))}; the file's labels are "
            f"{', '.join(map(repr, labels))}"
        )
    return form.name, *found


def _checked(
    instrument: str, columns: dict[str, np.ndarray], notes, sign: int, dates=()
) -> Reading:
    kept, blank = thermometers.without_blank(columns)
    columns.clear()  # what is left out, or becomes another column, is not held beside it
    columns, notes = kept, [*notes, *blank]
    if "frequency_hertz" in columns:
        doubt = next((note for note in notes if note.startswith(text_table.ABORTED)), "")
        checked = checked_impedance(columns)
        return Reading(checked, instrument, "impedance", tuple(notes), doubt=doubt)
    columns, counted = with_net_counter(columns)
    series, more = checked_series(columns)
    series, probed = thermometers.living(series)
    told = (*notes, *more, *probed)
    return Reading(series, instrument, "series", told, sign or counted, dates)
