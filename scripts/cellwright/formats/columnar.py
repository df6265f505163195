"""Parquet and Arrow with the labels that a csv may have: read as the csv that they would make."""

import io

from cellwright import gate
from cellwright.formats.bdf import ARROW, DOUBLE_BYTE, PARQUET, opened, refused_at
from cellwright.refusal import Refusal

BATCH_ROWS = 1 << 14  # that are written at once
LONGEST_TEXT = 200  # letters of a cell; states and dates have some


def is_columnar(head: bytes) -> bool:
    """Whether a file begins as Parquet or Arrow."""
    return head.startswith((PARQUET, ARROW))


def labels_of(data: bytes) -> list[str]:
    """Names of the columns of the file."""
    return list(_schema(data).names)


def as_csv(data: bytes, labels: list[str], largest_megabyte: float | None = None) -> bytes:
    """Columns of the file by name as a text with tabs, its first line their names.

    Times of a date are written as 2024-03-01 12:00:00.5, in UTC where they have a zone.

    Raises
    ------
    Refusal
        A column holds neither numbers, nor texts, nor times, or texts that are too long; the file
        is damaged, or as a table larger than it may be.
    """
    from pyarrow import csv

    text, rows = io.BytesIO(), 0
    text.write("\t".join(" ".join(label.split()) for label in labels).encode() + b"\n")
    how = csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    with refused_at(_kind(data)):
        for batch in _batches(data, labels):
            rows += batch.num_rows
            gate.refuse_unpacked(rows * DOUBLE_BYTE * len(labels), len(data), largest_megabyte)
            csv.write_csv(_as_written(batch), text, how)
    return text.getvalue()


def _kind(data):
    return "Parquet" if data.startswith(PARQUET) else "Arrow"


def _schema(data):
    import pyarrow as pa

    with refused_at(_kind(data)):
        if data.startswith(PARQUET):
            return opened(data).schema_arrow
        return pa.ipc.open_file(pa.BufferReader(data)).schema


def _batches(data, labels):
    """Pieces of the columns; texts of Parquet as they are packed, for they may be of any length."""
    import pyarrow as pa
    from pyarrow import parquet

    if data.startswith(ARROW):
        file = pa.ipc.open_file(pa.BufferReader(data))
        for number in range(file.num_record_batches):
            yield file.get_batch(number).select(labels)
        return
    schema = _schema(data)
    texts = [name for name in labels if _is_text(schema.field(name).type)]
    file = parquet.ParquetFile(pa.BufferReader(data), read_dictionary=texts)
    yield from file.iter_batches(BATCH_ROWS, columns=labels)


def _is_text(kind):
    import pyarrow as pa

    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def _as_written(batch):
    """A batch whose columns are numbers and texts."""
    import pyarrow as pa

    names, columns = batch.schema.names, batch.columns
    return pa.table([_written(*pair) for pair in zip(names, columns, strict=True)], names)


def _written(label, column):
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    values = column.dictionary if pa.types.is_dictionary(kind) else column
    if _is_text(values.type):
        longest = pc.max(pc.utf8_length(values)).as_py() or 0
        if longest > LONGEST_TEXT:
            raise Refusal(f"column {label!r} holds a text of {longest} letters; numbers are wanted")
        return column.cast(pa.string())
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return pc.strftime(column.cast(pa.timestamp("us")), format="%Y-%m-%d %H:%M:%S")
    if pa.types.is_duration(kind):
        return pc.divide(column.cast(pa.duration("us")).cast(pa.int64()).cast(pa.float64()), 1e6)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return column.cast(pa.float64(), safe=False)
    raise Refusal(f"column {label!r} holds {kind}; numbers are wanted")
