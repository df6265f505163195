"""Raw files of a test, held against the checksums of the sheet; large ones are read in blocks."""

import hashlib
import io
import os

from cellwright import gate
from cellwright.refusal import Refusal

CAMPAIGN = "."  # jobs run in its folder


def readable(files, largest_megabyte=None) -> list[str]:
    """Those of some files, paths relative to the campaign, that the gate opens.

    They are the inputs of a job. What another one is the job itself says, and loses nothing else.
    """
    return [file for file in files if not gate.obstacle(file, CAMPAIGN, largest_megabyte)]


def contents(files, sha256, largest_megabyte=None) -> list[tuple]:
    """(path, bytes, or of a large file the open file) of each file of a test, in order.

    Parameters
    ----------
    files : list of paths relative to the campaign
    sha256 : list of hexadecimal checksums, one a file, or None
    largest_megabyte : length from which on a file is refused [MB]; None: the default

    Raises
    ------
    Refusal
        The gate does not open a file (missing, no file, outside the campaign, too long), or it is
        empty, or another one than the sheet says.
    """
    if not files:
        raise Refusal("tests.tsv names no file for this test")
    # Checksums are optional in the sheet; without one any content of that name is taken.
    sums = sha256 or [None] * len(files)
    pairs = zip(files, sums, strict=True)
    return [(file, _bytes(file, wanted, largest_megabyte)) for file, wanted in pairs]


def single(files, sha256, largest_megabyte=None) -> tuple[str, bytes]:
    """(path, bytes) of a test that is one file.

    Raises
    ------
    Refusal
        As `contents`, and where the sheet joins several files.
    """
    several = contents(files, sha256, largest_megabyte)
    if len(several) > 1:
        raise Refusal(f"{len(files)} files are joined ({';'.join(files)}); a spectrum is one file")
    return several[0]


def _bytes(file, wanted, largest_megabyte):
    data = gate.content_at(
        file, within=CAMPAIGN, largest_megabyte=largest_megabyte, opener=_Unchanged
    )
    if not isinstance(data, bytes):
        return _of_checksum(data, file, wanted)
    if not data:
        raise Refusal(f"{file}: the file is empty (0 bytes)")
    # Of the bytes that are used: a file may change between a look at it and its reading.
    _refuse_other(file, hashlib.sha256(data).hexdigest(), wanted)
    return data


def _of_checksum(opened, file, wanted):
    """The open file, of which what is read is what the checksum was made of."""
    if wanted:
        _refuse_other(file, hashlib.file_digest(opened, "sha256").hexdigest(), wanted)
    opened.seek(0)
    return opened


def _refuse_other(file, checksum, wanted):
    if wanted and checksum != wanted.lower():
        raise Refusal(f"{file}: SHA-256 is {checksum}, tests.tsv says {wanted}")


class _Unchanged(io.FileIO):
    """A file that is refused where it was written to since it was opened."""

    def __init__(self, path, mode="rb", **how):
        super().__init__(path, mode, **how)
        self.version = self._version()

    def _version(self):
        about = os.fstat(self.fileno())
        return about.st_size, about.st_mtime_ns

    def readinto(self, buffer):
        found = super().readinto(buffer)
        if not found and self._version() != self.version:
            raise Refusal(f"{self.name}: the file was written to while it was read")
        return found
