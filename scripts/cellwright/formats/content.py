"""The content of a file: whole in memory, or its head alone and the rest read in blocks.

A reader of texts takes either; only what it keeps of a row, its numbers, then stays in memory.
"""

import io
from collections.abc import Callable
from typing import NamedTuple

from cellwright import gate
from cellwright.formats.container import GZIP, UTF_16, ZSTANDARD, unpacked
from cellwright.refusal import Refusal

HEAD = 1 << 20  # byte at the beginning of a large file that are in memory
SMALL = 1 << 23  # byte of a compressed file that is unpacked whole: at most a hundred times as much
# Byte that are read at once. What pyarrow makes of them takes some fifty times as much, and of so
# many the least CPU time.
BLOCK = 1 << 20
PIECE = 1 << 17  # byte of Zstandard that are unpacked at once
BOM = b"\xef\xbb\xbf"  # of UTF-8


class Content(NamedTuple):
    """A file too large to be held: its first bytes, and how to read it anew from the beginning.

    head : bytes, unpacked, as UTF-8 where the file is UTF-16.
    stream : function without arguments → readable of the same bytes, from the first on.
    """

    head: bytes
    stream: Callable


def content_of(source, largest_megabyte=None) -> bytes | Content:
    """Content of a file's bytes, or of an open binary file that can be sought in.

    Parameters
    ----------
    source : bytes, or the open file. largest_megabyte : to which it may unpack, see `gate`.

    Raises
    ------
    Refusal
        No byte at all, the compressed file is cut off or damaged, or it unpacks to too much.
    """
    if isinstance(source, bytes):
        if len(source) <= SMALL or not source.startswith((GZIP, ZSTANDARD)):
            return unpacked(source, largest_megabyte).removeprefix(BOM)
        source = io.BytesIO(source)

    def stream():
        return io.BufferedReader(_Unpacked(source, largest_megabyte), BLOCK)

    head = _filled(stream(), HEAD)
    if not head:
        raise Refusal("the file is empty (0 bytes)")
    return Content(head, stream)


def head_of(data: bytes | Content) -> bytes:
    """What of the content is in memory, from its first byte on."""
    return data if isinstance(data, bytes) else data.head


def whole_of(data: bytes | Content) -> bytes:
    """All of the content, for readers that need it at once."""
    return data if isinstance(data, bytes) else data.stream().read()


def stream_from(data: bytes | Content, offset: int):
    """A readable of the content from a byte on, which lies in its head."""
    if isinstance(data, bytes):
        import pyarrow as pa

        return pa.BufferReader(pa.py_buffer(data).slice(offset))
    stream = data.stream()
    stream.read(offset)
    return stream


def with_lines_changed(
    data: bytes | Content, offset: int, change: Callable[[bytes], bytes]
) -> bytes | Content:
    """The content whose lines from a byte on are changed: `change` takes and gives whole lines."""
    if isinstance(data, bytes):
        return data[:offset] + change(data[offset:])

    def stream():
        return io.BufferedReader(_Changed(data.stream(), offset, change), BLOCK)

    return Content(_filled(stream(), HEAD), stream)


def _filled(stream, size):
    """As many bytes of a stream as asked for, or as there are."""
    return stream.read(size) or b""


class _Unpacked(io.RawIOBase):
    """An open file from its first byte on, unpacked, UTF-16 as UTF-8."""

    def __init__(self, file, largest_megabyte):
        import codecs

        self.unpacked, self.packed = 0, file.seek(0, 2)
        self.largest_megabyte = largest_megabyte
        file.seek(0)
        mark = file.read(4)
        file.seek(0)
        self.file = _decompressed(file, mark)
        first = b"".join(self._call(self.file.read, 1) for _ in BOM)
        self.text = codecs.getincrementaldecoder("utf-16")() if first[:2] in UTF_16 else None
        self.rest = self.text.decode(first).encode() if self.text else first.removeprefix(BOM)

    def readable(self):
        return True

    def readinto(self, buffer):
        if not self.rest and self.text is None:
            return self._call(self.file.readinto, buffer)
        while not self.rest:
            data = self._call(self.file.read, len(buffer))
            if not data:
                self._finish()
                return 0
            self.rest = self.text.decode(data).encode() if self.text else data
        taken = self.rest[: len(buffer)]
        self.rest = self.rest[len(taken) :]
        buffer[: len(taken)] = taken
        return len(taken)

    def _call(self, read, argument):
        import gzip
        import zlib

        import zstandard

        try:
            found = read(argument)
        except EOFError:
            raise Refusal("the gzip file is cut off") from None
        except (zlib.error, gzip.BadGzipFile) as fault:
            raise Refusal(f"the gzip file is damaged: {fault}") from None
        except zstandard.ZstdError as fault:
            raise Refusal(f"the Zstandard file is damaged: {fault}") from None
        self.unpacked += found if isinstance(found, int) else len(found)
        gate.refuse_unpacked(self.unpacked, self.packed, self.largest_megabyte)
        return found

    def _finish(self):
        if self.text:
            try:
                self.text.decode(b"", final=True)
            except UnicodeDecodeError as fault:
                raise Refusal(f"the UTF-16 text is cut off or damaged: {fault}") from None


def _decompressed(file, mark):
    import gzip

    if mark.startswith(GZIP):
        return gzip.GzipFile(fileobj=file)
    if mark.startswith(ZSTANDARD):
        return _ZstandardFrames(file)
    return file


class _ZstandardFrames(io.RawIOBase):
    """Frames of Zstandard one behind the other; one that does not end is refused."""

    def __init__(self, file):
        self.file, self.frame, self.rest = file, None, b""

    def readable(self):
        return True

    def readinto(self, buffer):
        while not self.rest:
            if not self._unpack():
                return 0
        taken = self.rest[: len(buffer)]
        self.rest = self.rest[len(taken) :]
        buffer[: len(taken)] = taken
        return len(taken)

    def _unpack(self):
        """Unpack the next piece; whether there was one."""
        import zstandard

        ended = self.frame is not None and self.frame.eof
        packed = (self.frame.unused_data if ended else b"") or self.file.read(PIECE)
        if not packed:
            if self.frame is not None and not ended:
                raise Refusal("the Zstandard file is cut off")
            return False
        if self.frame is None or ended:
            self.frame = zstandard.ZstdDecompressor().decompressobj()
        self.rest = self.frame.decompress(packed)
        return True


class _Changed(io.RawIOBase):
    """A stream whose lines from a byte on are changed, block by block."""

    def __init__(self, stream, offset, change):
        self.stream, self.change = stream, change
        self.rest, self.cut = stream.read(offset), b""

    def readable(self):
        return True

    def readinto(self, buffer):
        while not self.rest:
            block = self.stream.read(BLOCK)
            if not block and not self.cut:
                return 0
            lines, end, after = (self.cut + block).rpartition(b"\n")
            if not block:  # the last line has no end
                lines, end, after = self.cut, b"", b""
            self.cut = after
            self.rest = self.change(lines + end)
        taken = self.rest[: len(buffer)]
        self.rest = self.rest[len(taken) :]
        buffer[: len(taken)] = taken
        return len(taken)
