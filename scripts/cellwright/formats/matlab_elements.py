"""Elements of a .mat before anything makes arrays of them: what they claim is held against bytes.

The library makes room for all members of an array at once, of as many as a damaged file claims, and
reads beyond its own tables where data are of a kind that there is not. Source: MAT-File Level 5.
"""

import math
import zlib
from collections.abc import Iterator

from cellwright import gate
from cellwright.refusal import Refusal

HEADER = 128  # byte before the first element
ARRAY, COMPRESSED = 14, 15
KINDS = {*range(1, 8), 9, *range(12, 19)}
FLAGS, SHAPE, NAME = 6, 5, 1  # kinds of the first three elements of an array
CELLS, STRUCTURE, OBJECT, TEXT, SPARSE, NUMBERS = 1, 2, 3, 4, 5, range(6, 16)  # classes of arrays
WITHOUT_SHAPE = (16, 17)  # functions, and objects of MATLAB's own such as tables
COMPLEX = 0x0800
DEEPEST = 32  # arrays in arrays: structures in structures of a record are a few


def refuse_damaged(data: bytes, largest_megabyte: float | None = None) -> None:
    """Refuse a .mat that unpacks to too much, or whose arrays are not what they say.

    Parameters
    ----------
    data : the whole file. largest_megabyte : as of `gate.obstacle`.

    Raises
    ------
    Refusal
    """
    order = "little" if data[126:128] == b"IM" else "big"
    total = 0
    for kind, start, stop in _elements(data, HEADER, len(data), order):
        if kind != COMPRESSED:
            _refuse_false_arrays(data, (start - 8, stop), order)
            continue
        parts = []
        for part in _unpacked(data[start:stop]):
            total += len(part)
            gate.refuse_unpacked(total, len(data), largest_megabyte)
            parts.append(part)
        whole = b"".join(parts)
        _refuse_false_arrays(whole, (0, len(whole)), order)


def _unpacked(packed):
    element = zlib.decompressobj()
    while packed and not element.eof:
        try:
            yield element.decompress(packed, gate.CHUNK)
        except zlib.error as fault:
            raise _damaged(str(fault)) from None
        packed = element.unconsumed_tail


def _damaged(how):
    return Refusal(f"the MATLAB file is cut off or damaged: {how}")


def _elements(data, start, stop, order) -> Iterator[tuple[int, int, int]]:
    """Kind, first byte and end of each element of a file, or of an array in it."""
    while start + 8 <= stop:
        kind, size = (int.from_bytes(data[start + k : start + k + 4], order) for k in (0, 4))
        begin, end = start + 8, start + 8 + size
        # All but compressed ones are filled up to a multiple of eight bytes.
        start = end if kind == COMPRESSED else begin + -(-size // 8) * 8
        if kind >> 16:  # of four bytes at most, which stand in the place of the length
            kind, begin, end, start = kind & 0xFFFF, begin - 4, begin - 4 + (kind >> 16), begin
        if kind not in KINDS or end > stop:
            raise _damaged(f"byte {begin} begins an element of kind {kind} and {end - begin} bytes")
        yield kind, begin, end


def _refuse_false_arrays(data, whole, order):
    """Refuse what is wrong in the arrays of a part of a file, at any depth."""
    inside = [whole]
    for _ in range(DEEPEST):
        parts = [part for first, last in inside for part in _elements(data, first, last, order)]
        inside = [(start, stop) for kind, start, stop in parts if kind == ARRAY]
        for start, stop in inside:
            fault = _fault(data, list(_elements(data, start, stop, order)), order, stop - start)
            if fault:
                raise _damaged(fault)
        if not inside:
            return
    raise Refusal(f"the MATLAB file holds arrays in arrays, more than {DEEPEST} deep")


def _fault(data, parts, order, size):
    """What is wrong in an array of these elements and this many bytes; "" where nothing is."""
    if not parts:  # an empty member of a structure
        return ""
    kind, start, _ = parts[0]
    flags = int.from_bytes(data[start : start + 4], order)
    if kind == FLAGS and flags & 0xFF in WITHOUT_SHAPE:
        return ""
    if [kind for kind, _, _ in parts[:3]] != [FLAGS, SHAPE, NAME]:
        return "an array without flags, dimensions and a name"
    _, first, last = parts[1]
    sizes = [int.from_bytes(data[k : k + 4], order) for k in range(first, last, 4)]
    if math.prod(sizes) > size:
        return f"an array of {' × '.join(map(str, sizes))} members takes {size} bytes"
    wanted = _data_elements(flags)
    held = [kind for kind, _, _ in parts[3:]]
    if len(held) < wanted or not {ARRAY, COMPRESSED}.isdisjoint(held[:wanted]):
        return f"an array of class {flags & 0xFF} without its {wanted} elements of data"
    return ""


def _data_elements(flags):
    """How many elements of numbers or letters follow the name of an array."""
    kind, further = flags & 0xFF, int(bool(flags & COMPLEX))
    if kind in NUMBERS or kind == TEXT:
        return 1 + further
    return {SPARSE: 3 + further, STRUCTURE: 2, OBJECT: 3}.get(kind, 0)
