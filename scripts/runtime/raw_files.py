"""Raw files of a test, held against the checksums of the sheet; large ones are read in blocks."""

import hashlib
import io
import os
from pathlib import Path

from cellwright.formats.content import LARGE
from cellwright.refusal import Refusal


def contents(files, sha256) -> list[tuple]:
    """(path, bytes, or of a large file the open file) of each file of a test, in order.

    Parameters
    ----------
    files : list of paths relative to the campaign
    sha256 : list of hexadecimal checksums, one a file, or None

    Raises
    ------
    Refusal
        A file is missing, a folder, empty, unreadable, or another one than the sheet says.
    """
    if not files:
        raise Refusal("tests.tsv names no file for this test")
    # Checksums are optional in the sheet; without one any content of that name is taken.
    sums = sha256 or [None] * len(files)
    return [(file, _bytes(file, wanted)) for file, wanted in zip(files, sums, strict=True)]


def single(files, sha256) -> tuple[str, bytes]:
    """(path, bytes) of a test that is one file.

    Raises
    ------
    Refusal
        As `contents`, and where the sheet joins several files.
    """
    several = contents(files, sha256)
    if len(several) > 1:
        raise Refusal(f"{len(files)} files are joined ({';'.join(files)}); a spectrum is one file")
    return several[0]


def _bytes(file, wanted) -> bytes:
    path = Path(file)
    if path.is_dir():
        raise Refusal(f"{file}: is a folder, wanted a file")
    if not path.exists():
        raise Refusal(f"{file}: there is no such file in the campaign")
    try:
        if path.stat().st_size > LARGE:
            return _opened(file, wanted)
        data = path.read_bytes()
    except OSError as error:
        raise Refusal(f"{file}: cannot be read: {error.strerror}") from None
    if not data:
        raise Refusal(f"{file}: the file is empty (0 bytes)")
    # Of the bytes that are used: a file may change between a look at it and its reading.
    _refuse_other(file, hashlib.sha256(data).hexdigest(), wanted)
    return data


def _opened(file, wanted):
    """The open file, of which what is read is what the checksum was made of."""
    opened = io.BufferedReader(_Unchanged(file))
    if wanted:
        _refuse_other(file, hashlib.file_digest(opened, "sha256").hexdigest(), wanted)
    opened.seek(0)
    return opened


def _refuse_other(file, checksum, wanted):
    if wanted and checksum != wanted.lower():
        raise Refusal(f"{file}: SHA-256 is {checksum}, tests.tsv says {wanted}")


class _Unchanged(io.FileIO):
    """A file that is refused where it was written to since it was opened."""

    def __init__(self, path):
        super().__init__(path)
        self.version = self._version()

    def _version(self):
        about = os.fstat(self.fileno())
        return about.st_size, about.st_mtime_ns

    def readinto(self, buffer):
        found = super().readinto(buffer)
        if not found and self._version() != self.version:
            raise Refusal(f"{self.name}: the file was written to while it was read")
        return found
