"""What an Arrow file takes in memory, from its own index and without unpacking any of it.

Each of its batches has a message with the number of rows and the place of each buffer; a compressed
buffer begins with the length of what it unpacks to. Source: format/File.fbs and Message.fbs of
Apache Arrow; tables of FlatBuffers as its internals say.
"""

import numpy as np

MARK = 6  # byte of b"ARROW1", which also ends the file, behind the length of the index
LONG, WORD, HALF = 8, 4, 2  # byte of integers
BLOCK = np.dtype([("offset", "<i8"), ("message", "<i4"), ("pad", "<i4"), ("body", "<i8")])
BUFFER = np.dtype([("offset", "<i8"), ("length", "<i8")])
DICTIONARY_BATCH, RECORD_BATCH = 2, 3
CONTINUED = b"\xff\xff\xff\xff"


def unpacked_byte(data: bytes, columns: int) -> int:
    """Bytes that all buffers unpack to, and as many columns of float64 of all rows beside them.

    Parameters
    ----------
    data : the whole file.
    columns : that are read, each as float64.

    Raises
    ------
    ValueError
        The index points out of the file.
    """
    end = len(data) - MARK - WORD
    index = _root(data, end - _integer(data, end, WORD))
    total = 0
    for field in (2, 3):  # dictionaries, batches of rows
        for block in _structures(data, index, field, BLOCK):
            place = int(block["offset"])
            message = place + WORD * (1 + (data[place : place + WORD] == CONTINUED))
            rows, unpacked = _batch(data, _root(data, message), place + int(block["message"]))
            total += unpacked + rows * columns * LONG
    return total


def _batch(data, message, body):
    """Rows of a batch and bytes that its buffers unpack to; `body` is where they lie."""
    kind, batch = _integer(data, _field(data, message, 1), 1), _below(data, message, 2)
    if kind == DICTIONARY_BATCH:
        batch = _below(data, batch, 1)
    elif kind != RECORD_BATCH:
        raise ValueError(f"a message of kind {kind} where a batch is wanted")
    rows = _integer(data, _field(data, batch, 0), LONG)
    packed = _field(data, batch, 3) is not None
    buffers = _structures(data, batch, 2, BUFFER)
    lengths = [
        _unpacked(data, body + int(one["offset"]), int(one["length"])) if packed else one["length"]
        for one in buffers
        if one["length"] > 0
    ]
    return max(0, rows), int(sum(lengths))


def _unpacked(data, place, length):
    """Bytes that a compressed buffer unpacks to; -1 before them says that it is not compressed."""
    said = _integer(data, place, LONG)
    return length if said < 0 else said


def _integer(data, place, size):
    """An integer at a place; what is not there, as a table may leave it out, is 0."""
    if place is None:
        return 0
    if not 0 <= place <= len(data) - size:
        raise ValueError("its index points out of the file")
    return int.from_bytes(data[place : place + size], "little", signed=True)


def _root(data, place):
    return place + _integer(data, place, WORD)


def _field(data, table, number):
    """Where a field of a table stands; None where the table leaves it out."""
    known = table - _integer(data, table, WORD)
    entry = HALF * (2 + number)
    offset = _integer(data, known + entry, HALF) if entry < _integer(data, known, HALF) else 0
    return table + offset if offset else None


def _below(data, table, number):
    """Where the table or list of a field begins."""
    place = _field(data, table, number)
    if place is None:
        raise ValueError("its index lacks a part")
    return _root(data, place)


def _structures(data, table, number, kind):
    """A list of structures of a field; empty where the table leaves it out."""
    if _field(data, table, number) is None:
        return np.empty(0, kind)
    begin = _below(data, table, number)
    return np.frombuffer(data, kind, _integer(data, begin, WORD), begin + WORD)
