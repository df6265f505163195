"""What kind of bytes a file holds: compressed ones unpacked, foreign ones recognised by sight."""

import re

from cellwright import gate
from cellwright.formats.matlab_elements import refuse_damaged
from cellwright.refusal import Refusal

GZIP = b"\x1f\x8b"
ZSTANDARD = b"\x28\xb5\x2f\xfd"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
ZIP = b"PK\x03\x04"
MATLAB = b"MATLAB 5.0 MAT-file"
ARCHIVES = {b"xl/": "Excel workbook", b"[Content_Types]": "Excel workbook", b".ndc": "ndax archive"}
PIECE = 1 << 12  # byte of Zstandard that are unpacked at once: to 130 MB at most
CELL_BYTE = 32  # that a cell of a sheet takes in memory, also a blank one
# Of a sheet: numbers of rows, columns of cells that hold something, cells that do not say theirs.
ROW = re.compile(rb"""\br\s*=\s*["'][A-Za-z]{0,3}(\d{1,7})""")
# No part of one crosses the beginning of the next tag, or ends at every place where it could.
CELL = re.compile(rb"""<(?:\w+:)?c\s(?=[^<>]*+(?<!/)>)[^<>]*?\br\s*=\s*["']([A-Za-z]{1,3})\d""")
UNPLACED = re.compile(rb"<(?:\w+:)?c(?=[\s/>])(?![^<>]*\br\s*=)")
LONGEST_ROW = 1 << 22  # byte: of 4096 cells, each of 1000


def unpacked(data: bytes, largest_megabyte=None) -> bytes:
    """The content of a gzip or Zstandard file, and UTF-16 as UTF-8; all else as it is.

    Parameters
    ----------
    data : the whole file.
    largest_megabyte : to which it may unpack, also what unpacks further on (a workbook or another
        archive, a .mat); None: the default of `settings.Files`.

    Raises
    ------
    Refusal
        No byte at all, the compressed file is cut off or damaged, or unpacks to too much.
    """
    if not data:
        raise Refusal("the file is empty (0 bytes)")
    if data.startswith(GZIP):
        data = _gunzipped(data, largest_megabyte)
    elif data.startswith(ZSTANDARD):
        data = _unzstandard(data, largest_megabyte)
    if data.startswith(ZIP):
        _refuse_large_archive(data, largest_megabyte)
    if data.startswith(MATLAB):
        refuse_damaged(data, largest_megabyte)
    return _utf_8(data) if data.startswith(UTF_16) else data


def _utf_8(data):
    try:
        return data.decode("utf-16").encode()
    except UnicodeDecodeError as fault:
        raise Refusal(f"the UTF-16 text is cut off or damaged: {fault}") from None


def _gunzipped(data: bytes, largest_megabyte) -> bytes:
    import gzip
    import io
    import zlib

    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            chunks = iter(lambda: stream.read(gate.CHUNK), b"")
            return gate.joined(chunks, len(data), largest_megabyte)
    except EOFError:
        raise Refusal(f"the gzip file is cut off after {len(data)} bytes") from None
    except (zlib.error, gzip.BadGzipFile) as fault:
        raise Refusal(f"the gzip file is damaged: {fault}") from None


def _unzstandard(data: bytes, largest_megabyte) -> bytes:
    import zstandard

    try:
        return gate.joined(_frames(data), len(data), largest_megabyte)
    except zstandard.ZstdError as fault:
        raise Refusal(f"the Zstandard file is damaged: {fault}") from None


def _frames(data):
    """Pieces of the content of each frame, of which a file may have several."""
    import zstandard

    place, size = 0, 0
    while place < len(data):
        frame = zstandard.ZstdDecompressor().decompressobj()
        while place < len(data) and not frame.eof:
            part = frame.decompress(data[place : place + PIECE])
            place = min(place + PIECE, len(data)) - len(frame.unused_data)
            size += len(part)
            yield part
        if not frame.eof:
            raise Refusal(f"the Zstandard file is cut off: its last frame ends after {size} bytes")


def _refuse_large_archive(data, largest_megabyte):
    """Refuse a zip archive by what its parts really hold, for their lengths may be misstated."""
    import io
    import zipfile
    import zlib

    # Whatever a damaged archive can make of the module's reader.
    faults = (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError)
    total = 0
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            parts = archive.infolist()
            gate.refuse_unpacked(sum(p.file_size for p in parts), len(data), largest_megabyte)
            # A workbook says itself in which of its parts the sheets stand.
            sheets = any(part.filename.startswith("xl/") for part in parts)
            for part in parts:
                rest, extent = b"", (0, 0)
                with archive.open(part) as stream:
                    for chunk in iter(lambda: stream.read(gate.CHUNK), b""):
                        total += len(chunk)
                        gate.refuse_unpacked(total, len(data), largest_megabyte)
                        if sheets:
                            extent, rest = _extent(rest + chunk, extent)
                laid_out = CELL_BYTE * extent[0] * extent[1]
                gate.refuse_unpacked(laid_out, len(data), largest_megabyte)
    except Refusal:
        raise
    except (*faults, NotImplementedError) as fault:
        what = next((what for mark, what in ARCHIVES.items() if mark in data), "zip archive")
        raise Refusal(f"the {what} is cut off or damaged: {fault}") from None


def _extent(text, before):
    """Largest row and column of a sheet so far, and the text of a row that goes on.

    All cells up to them are laid out in memory, one far out takes all there is.
    """
    rows = [int(number) for number in ROW.findall(text)]
    columns = [_column(letters) for letters in set(CELL.findall(text))]
    if UNPLACED.search(text):
        columns.append(max(row.count(b"<c") for row in text.split(b"<row")))
    start = text.rfind(b"<row")
    if start >= 0 and len(text) - start > LONGEST_ROW:
        raise Refusal(f"a row of a sheet is longer than {LONGEST_ROW} bytes")
    rest = text[start:] if start >= 0 else b""
    return (max([before[0], *rows]), max([before[1], *columns])), rest


def _column(letters):
    """Number of a column of a sheet: A is 1, AA 27."""
    number = 0
    for letter in letters.upper():
        number = 26 * number + letter - 64
    return number


# First bytes, and what a file that begins so is. Order matters where one begins like another.
BEGINNINGS = (
    (b"BIO-LOGIC MODULAR FILE", "a BioLogic mpr file (export it as text, mpt, in EC-Lab)"),
    (b"\x89HDF\r\n", "an HDF5 file (such as MATLAB 7.3)"),
    (b"ARROW1", "an Arrow (Feather) file"),
    (b"\xd0\xcf\x11\xe0", "an old Office file (xls)"),
    (b"%PDF", "a PDF file"),
    (b"<?xml", "an XML file"),
    (b"\x89PNG", "a picture"),
)


def sight(data: bytes) -> str | None:
    """What a file without a reader is, as a noun phrase; None where it is not known."""
    if data.startswith(ZIP):
        return "a zip archive"
    head = data[:64].removeprefix(b"\xef\xbb\xbf")
    return next((what for mark, what in BEGINNINGS if head.startswith(mark)), None)
