"""Delimited text as arrays of numbers."""

import codecs
import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from cellwright.formats.content import BLOCK, Content, head_of, stream_from, with_lines_changed
from cellwright.formats.fields import label_of
from cellwright.gate import refuse_columns
from cellwright.refusal import Refusal

NO_NUMBER = ("", "NaN", "nan", "NA", "N/A", "null", "NULL")
# A cell without a digit says that there is no value (n/a, OverRange); one with some is damaged.
WORD = re.compile(r"\D{1,20}|\s*#DIV/0!\s*")
LINES_TOLD = 5
DELIMITERS = ",;\t"
PIECE_ROWS = 1 << 20
EXAMPLE = 1 << 15  # byte of rows by which a table's layout is told
# Of columns that name the channel of each row, where a file may hold several.
CHANNEL = r"(?:test|channel)[ _]?(?:id|index|number|no\.?)|channel"
HIGH = re.compile(rb"[\x80-\xff]+")
ASCII = bytes([*range(128), *b"?" * 128])
WITH_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
WITH_POINT = re.compile(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?")


class Layout(NamedTuple):
    """How a text file is laid out."""

    labels: tuple[str, ...]  # one per field of a row, in the file's order
    delimiter: str
    first_line: int  # 1-based number, in the file, of the first line of data
    decimal_point: str = "."


class Table(NamedTuple):
    """Columns of a text by label, and notes on rows that were left out."""

    columns: dict  # label → float64 array (missing numbers NaN), or what is kept of `texts`
    notes: tuple[str, ...]


def decoded(data: bytes) -> str:
    """Text of `data`: UTF-8 with or without its mark, GB 18030, or else Latin-1.

    Instruments write the last two. Chinese characters are pairs of bytes above 0x7f, which those of
    Western texts, such as that of a degree, hardly ever all are. The sign for a degree Celsius
    that is one letter in Chinese texts is written as two.
    """
    for code in ("utf-8-sig", "gb18030") if _are_pairs(data) else ("utf-8-sig",):
        try:
            return data.decode(code).replace("\N{DEGREE CELSIUS}", "°C")
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1")


def line_of(data: bytes | Content, number: int) -> str:
    """Line `number` (1-based) of the file, without its end; empty beyond the last."""
    data = head_of(data)
    start = offset_of(data, number)
    end = data.find(b"\n", start)
    return decoded(data[start : len(data) if end < 0 else end]).rstrip("\r")


def offset_of(data: bytes | Content, number: int) -> int:
    """Position of the first byte of line `number` (1-based); the file's length beyond the last."""
    data = head_of(data)
    position = 0
    for _ in range(number - 1):
        end = data.find(b"\n", position)
        if end < 0:
            return len(data)
        position = end + 1
    return position


def layout_of(data: bytes | Content, *, header_line: int = 1, units_lines: int = 0) -> Layout:
    """Layout of a file with its labels in `header_line`, data below it (and below its units)."""
    header = line_of(data, header_line)
    delimiter = max(DELIMITERS, key=header.count)
    labels = tuple(unquoted(label) for label in header.split(delimiter))
    refuse_columns(len(labels))
    first_line = header_line + 1 + units_lines
    rows = first_rows(data, first_line)
    layout = Layout(labels, delimiter, first_line, decimal_point_of(rows, delimiter))
    return with_trailing_delimiter(rows, layout)


def unquoted(label: str) -> str:
    """A label without blanks and quotation marks around it, as `fields.label_of` has it."""
    return label_of(label.strip().strip('"'))


def first_rows(data: bytes | Content, first_line: int) -> list[str]:
    """The first lines of a table that hold something, to tell its layout by."""
    begin = offset_of(data, first_line)
    lines = decoded(head_of(data)[begin : begin + EXAMPLE]).split("\n")
    whole = lines[:-1] if len(lines) > 1 else lines
    return [line.rstrip("\r") for line in whole if line.strip()]


def decimal_point_of(rows: Sequence[str], delimiter: str) -> str:
    """The decimal point of a file: a comma where more cells of its first rows have one.

    A number with the other one is then none, and is refused where it is read: a comma between
    thousands is never taken for a decimal one beside numbers with a point.
    """
    if delimiter == ",":
        return "."
    cells = [unquoted(cell) for row in rows for cell in row.split(delimiter)]
    commas, points = (sum(map(bool, map(x.fullmatch, cells))) for x in (WITH_COMMA, WITH_POINT))
    return "," if commas > points else "."


def with_trailing_delimiter(rows: Sequence[str], layout: Layout) -> Layout:
    """The layout with one more, nameless field where rows end in a delimiter, the labels not.

    Raises
    ------
    Refusal
        The first row has a value more than there are labels: which of them has none is not said,
        and each value might stand under another's label.
    """
    row = next(csv.reader(rows[:1], delimiter=layout.delimiter), [])
    if len(row) != len(layout.labels) + 1:
        return layout
    if row[-1].strip():
        some = ", ".join(map(repr, layout.labels[:3]))
        raise Refusal(
            f"rows have {len(row)} values and only {len(layout.labels)} labels ({some}, …); the "
            f"first row begins with {row[0]!r}, a row number? Give every column a label"
        )
    return layout._replace(labels=(*layout.labels, ""))


def read_table(
    data: bytes | Content, layout: Layout, labels: Sequence[str], *, texts: Mapping | Sequence = ()
) -> Table:
    """Read the named columns of a delimited text, block by block.

    Parameters
    ----------
    data : bytes or Content
        The file, unpacked.
    layout : Layout
    labels : sequence of str
        Columns to read as numbers; of equal labels the first in the file is read.
    texts : sequence of str, or mapping
        Columns to read as text; or of each a function without arguments → what keeps it: its
        `add` is given the column block by block (pyarrow strings), its `all` gives what is wanted.

    Returns
    -------
    Table, without a last row that has too few fields: the file was cut off there, as a note says.
    Columns that are not read are named in another. Words without a digit in place of a number are
    NaN, as a note says.

    Raises
    ------
    Refusal
        No row, another row with another number of fields, other text where a number belongs,
        words in most of its rows, or a quotation mark that makes one cell of many lines.
    """
    import pyarrow as pa

    begin = offset_of(data, layout.first_line)
    plain, words = data, {}
    if not _is_utf_8(head := head_of(data)[: 1 << 20]):
        # pyarrow knows no other text than UTF-8; only texts are worth their decoding.
        plain = with_lines_changed(data, begin, _in_utf_8(head) if texts else _ascii)
    try:
        columns, odd, rows, marks = _parsed(plain, begin, layout, labels, texts)
    except pa.ArrowInvalid:
        # pyarrow cannot say which row is cut off in a text that is none of UTF-8.
        plain, words = with_lines_changed(data, begin, _ascii), _words(data, layout, labels)
        try:
            taken = [word for _, word in words]
            columns, odd, rows, marks = _parsed(plain, begin, layout, labels, texts, taken)
        except pa.ArrowInvalid as fault:
            raise _fault(data, layout, labels, str(fault)) from None
    if marks % 2:
        _refuse_open_quotation(data, layout)
    blank = [row.number for row in odd if not row.text.strip()]
    odd = [row for row in odd if row.text.strip()]
    before = rows + sum(number < row.number for row in odd[:1] for number in blank)
    if not rows or len(odd) > 1 or (odd and not _is_cut_off(odd[0], before)):
        raise _fault(data, layout, labels, "it has no row")
    said = [_cut_off(row) for row in odd], _words_told(words), unread(layout.labels, columns)
    return Table(columns, tuple(chain.from_iterable(said)))


def _is_utf_8(head):
    """Whether the head of a file is UTF-8; its last letter may be cut."""
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return False
    return True


def _in_utf_8(head):
    """Function, bytes → bytes: lines in the encoding of a file's head as UTF-8."""
    try:
        head[: head.rfind(b"\n") + 1].decode("gb18030")
        code = "gb18030" if _are_pairs(head) else "latin-1"
    except UnicodeDecodeError:
        code = "latin-1"
    return lambda data: data.decode(code, "replace").encode()


def _are_pairs(data):
    """Whether bytes above 0x7f stand in pairs, as those of Chinese letters do."""
    return all(len(run) % 2 == 0 for run in HIGH.findall(data))


def _ascii(data):
    """Text with a question mark for each byte that is no ASCII: numbers have none."""
    return data.translate(ASCII)


def _parsed(data, begin, layout, labels, texts, words=()):
    """Columns by label, rows of another number of fields, numbers of good rows and of quotes."""
    import pyarrow as pa
    from pyarrow import csv as tables

    place = {label: str(layout.labels.index(label)) for label in (*labels, *texts)}
    types = {place[label]: pa.float64() for label in labels}
    types |= {place[label]: pa.string() for label in texts}
    odd, rows = [], 0
    keepers = texts if isinstance(texts, Mapping) else dict.fromkeys(texts, Words)
    kept = {place[label]: _Numbers() for label in labels}
    kept |= {place[label]: keeper() for label, keeper in keepers.items()}
    stream = _Quoted(stream_from(data, begin))
    reader = tables.open_csv(
        stream,
        tables.ReadOptions(
            column_names=[str(k) for k in range(len(layout.labels))],
            block_size=BLOCK,
            use_threads=False,
        ),
        tables.ParseOptions(
            delimiter=layout.delimiter,
            invalid_row_handler=lambda row: odd.append(row) or "skip",
        ),
        tables.ConvertOptions(
            include_columns=list(types),
            column_types=types,
            null_values=[*NO_NUMBER, *words],
            decimal_point=layout.decimal_point,
        ),
    )
    for block in reader:
        rows += block.num_rows
        for name in types:
            kept[name].add(block.column(name))
    columns = {label: kept[place[label]].all() for label in labels if rows}
    columns |= {label: kept[place[label]].all() for label in texts}
    return columns, odd, rows, stream.marks


def is_written(data: bytes | Content, layout: Layout, label: str) -> bool:
    """Whether a time is written as a date or clock: its first cell is no number."""
    place = layout.labels.index(label)
    rows = csv.reader(first_rows(data, layout.first_line), delimiter=layout.delimiter)
    cells = (row[place].strip() for row in rows if len(row) > place)
    return not is_number(next(filter(None, cells), ""), layout.decimal_point)


def refuse_channels(columns: Mapping, labels: Sequence[str]) -> None:
    """Refuse a table in which a column (as of `Words`) names several channels, with their names.

    A column whose values never recur counts rows, whatever it is called.
    """
    for label in labels:
        texts = columns[label]
        names = dict.fromkeys(name.strip() for name in texts.unique().to_pylist() if name)
        names.pop("", None)
        if 1 < len(names) < len(texts):
            some = ", ".join(list(names)[:5]) + ", …" * (len(names) > 5)
            raise Refusal(
                f"column {label!r} names {len(names)} channels ({some}): one channel a file is "
                "wanted, export each by itself"
            )


class _Quoted(io.RawIOBase):
    """A readable of bytes whose quotation marks are counted as they pass."""

    def __init__(self, stream):
        self.stream, self.marks = stream, 0

    def readable(self):
        return True

    def read(self, size=-1):
        """The next bytes, as many as asked for where there are so many."""
        block = self.stream.read(size)
        # To find none is four times as fast as to count them.
        self.marks += block.count(b'"') if b'"' in block else 0
        return block


class _Numbers:
    """A column of numbers that grows by the blocks a text is read in, without a copy of it all."""

    def __init__(self):
        self.pieces, self.last, self.filled, self.rows = [], np.empty(0), 0, 0

    def add(self, block):
        """Put a block of the column (a pyarrow array) behind the others."""
        if self.filled + len(block) > len(self.last):
            self.pieces.append(self.last[: self.filled])
            self.last = np.empty(max(len(block), min(self.rows, PIECE_ROWS)))
            self.filled = 0
        self.last[self.filled : self.filled + len(block)] = block.to_numpy(zero_copy_only=False)
        self.filled += len(block)
        self.rows += len(block)

    def all(self):
        """All numbers, NaN where there is none."""
        numbers = np.concatenate([*self.pieces, self.last[: self.filled]])
        self.pieces, self.last = [], np.empty(0)
        return numbers


class Words:
    """A column of texts, of which few differ; four bytes of a row."""

    def __init__(self):
        self.blocks = []

    def add(self, block):
        """Keep a block of the column (pyarrow strings)."""
        self.blocks.append(block.dictionary_encode())

    def all(self):
        """All texts, as a pyarrow array with a dictionary in the order in which they come."""
        import pyarrow as pa

        kind = pa.dictionary(pa.int32(), pa.string())
        return pa.chunked_array(self.blocks, kind).unify_dictionaries().combine_chunks()


def _is_cut_off(row, rows):
    """Whether a row that does not fit is the last line of the table, and too short.

    A stray quotation mark makes all lines after it one cell: these are no last line.
    """
    short = row.actual_columns < row.expected_columns and row.number == rows + 1
    return short and "\n" not in row.text.rstrip("\r\n")


def _cut_off(row):
    fields = f"{row.actual_columns} of {row.expected_columns} fields"
    return f"the last row is cut off ({fields}) and was left out"


def _fault(data, layout: Layout, labels: Sequence[str], otherwise: str) -> Refusal:
    """The first faulty line and what is wrong with it; slow, and only called where one is."""
    filled = False
    try:
        for number, row in _rows_of(data, layout):
            filled |= bool("".join(row).strip())
            if fault := _row_fault(layout, labels, row):
                return Refusal(f"line {number}: {fault}")
    except csv.Error as error:
        filled, otherwise = True, str(error)
    if not filled:
        return Refusal("the file has a header and no row of data")
    return Refusal(f"not a readable table: {otherwise}")


def _refuse_open_quotation(data, layout):
    """Refuse a cell that goes on over lines: its rows are lost, also where no column shows it.

    Asked where the number of quotation marks is odd.
    """
    rows, line = _reader(data, layout), 0
    try:
        for _ in rows:
            if rows.line_num > line + 1:
                break
            line = rows.line_num
        else:
            return
    except csv.Error:  # the cell is longer than the library's longest
        pass
    where = f"line {layout.first_line + line}"
    raise Refusal(f"{where}: a quotation mark opens a cell that goes on over the lines below it")


def _rows_of(data, layout):
    """Number of each line below the labels, and its cells; slow."""
    yield from enumerate(_reader(data, layout), layout.first_line)


def _reader(data, layout):
    lines = (decoded(x) for x in _lines(stream_from(data, offset_of(data, layout.first_line))))
    # The module of the library stops at a NUL.
    return csv.reader((x.replace("\0", "\ufffd") for x in lines), delimiter=layout.delimiter)


def _words(data, layout, labels):
    """Lines by (label, word as written) for each word in place of a number; slow.

    None where they stand in most rows of a column, for then it is one of words.
    """
    places = [(label, layout.labels.index(label)) for label in labels]
    found, rows, others = {}, 0, {}
    try:
        for number, row in _rows_of(data, layout):
            if len(row) != len(layout.labels):
                continue
            rows += 1
            for label, place in places:
                cell = row[place]
                if WORD.fullmatch(cell) and not is_number(cell.strip(), layout.decimal_point):
                    found.setdefault((label, cell), []).append(number)
                    others[label] = others.get(label, 0) + 1
    except csv.Error:
        return {}
    return {} if any(2 * count > rows for count in others.values()) else found


def unread(labels: Sequence[str], read: Iterable[str]) -> list[str]:
    """A sentence that names the columns of a file which are not read, where there are any."""
    others = [label for label in dict.fromkeys(labels) if label and label not in set(read)]
    return [f"columns that are not read: {', '.join(others)}"] if others else []


def _words_told(words):
    """A sentence on each word that stands in place of numbers."""
    for (label, word), lines in words.items():
        some = ", ".join(map(str, lines[:LINES_TOLD])) + ", …" * (len(lines) > LINES_TOLD)
        where = f"in {len(lines)} rows (line {some})" if len(lines) > 1 else f"in line {some}"
        yield f"column {label!r}: {word.strip()!r} {where} is no number and was left blank"


def _lines(stream):
    """Lines of a readable of bytes."""
    rest = b""
    while block := stream.read(BLOCK):
        *lines, rest = (rest + block).split(b"\n")
        yield from lines
    yield rest


def _row_fault(layout: Layout, labels: Sequence[str], row: list[str]) -> str:
    if len(row) < 2 and not "".join(row).strip():  # an empty line is no row
        return ""
    if len(row) != len(layout.labels):
        return (
            f"{len(row)} fields where {len(layout.labels)} are expected; "
            "the row is cut off or damaged"
        )
    cells = ((label, row[layout.labels.index(label)].strip()) for label in labels)
    wrong = next(((n, c) for n, c in cells if not is_number(c, layout.decimal_point)), None)
    return f"column {wrong[0]!r}: found {wrong[1]!r}, a number is wanted" if wrong else ""


def is_number(cell: str, decimal_point: str = ".") -> bool:
    """Whether a cell is a number, or says that there is none."""
    if cell in NO_NUMBER:
        return True
    if decimal_point != ".":
        cell = cell.replace(".", "x").replace(decimal_point, ".")
    try:
        np.float64(cell)
    except ValueError:
        return False
    return True
