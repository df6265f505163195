"""Files of the user's: what they hold when a run is planned, and that its jobs read just that.

A file's time does not tell whether it is another one: a copy may keep an older time. Rules have
`planned` contents among their parameters, so that another content makes a test anew, and jobs hold
against it what they read, and against the checksum of the sheet. Large files are read in blocks.
"""

import hashlib
import io
import os
import time
from functools import partial
from pathlib import Path

from cellwright import gate
from cellwright.refusal import Refusal
from runtime import kept

CAMPAIGN = "."  # jobs run in its folder
CHECKSUMS = Path(".snakemake", "cellwright", "checksums.json")
# The coarsest clock of a file system: what was written to since may be so again at the same time.
CLOCK_SECOND = 3.0


class Changed(OSError):
    """A file is no longer what it was when the run was planned, which another run may mend."""


def planned(largest_megabyte_of, memory=CHECKSUMS) -> dict[str, list]:
    """What the gate opens of some files, and their contents: path → [SHA-256, bytes].

    They are the inputs of jobs. What another one is the job itself says, and loses nothing else.

    Parameters
    ----------
    largest_megabyte_of : dict path relative to the campaign → length beyond which it is too long
        [MB], None: the default
    memory : file that keeps the checksums of files that have since not been touched: by their
        number, length and both times, of which nobody can set the second one
    """
    remembered, found = kept.read(memory), {}
    for file, largest in largest_megabyte_of.items():
        if gate.obstacle(file, CAMPAIGN, largest):
            continue
        try:
            found[file] = _identity_and_content(file, remembered.get(file, [None, None]))
        except OSError:  # as of a file that may not be read, which the job itself will say
            continue
    settled = time.time_ns() - CLOCK_SECOND * 1e9
    lasting = {file: known for file, known in found.items() if known[0][-1] < settled}
    if lasting != remembered:
        kept.write(memory, lasting)
    return {file: content for file, (_, content) in found.items()}


def _identity_and_content(file, remembered):
    about = os.stat(file)
    identity = [about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns, about.st_ctime_ns]
    if identity == remembered[0]:
        return remembered
    with open(file, "rb") as opened:
        digest = hashlib.file_digest(opened, "sha256").hexdigest()
        return [identity, [digest, opened.tell()]]


def changed(before, after) -> list[str]:
    """Files of which another content was planned with, from two results of `planned`."""
    return [file for file in before if after.get(file) != before[file]]


def contents(files, sha256, largest_megabyte=None, content=None) -> list[tuple]:
    """(path, bytes, or of a large file the open file) of each file of a test, in order.

    Parameters
    ----------
    files : list of paths relative to the campaign
    sha256 : list of hexadecimal checksums, one a file, or None
    largest_megabyte : length from which on a file is refused [MB]; None: the default
    content : what the run was `planned` with; None: whatever is there. Of a file that has grown
        since, as one does that a cycler writes to, what was there then is read.

    Raises
    ------
    Refusal
        The gate does not open a file (missing, no file, outside the campaign, too long), or it is
        empty, or another one than the sheet says.
    Changed
        It is another one than the run was planned with.
    """
    if not files:
        raise Refusal("tests.tsv names no file for this test")
    # Checksums are optional in the sheet; without one any content of that name is taken.
    sums = sha256 or [None] * len(files)
    pairs = zip(files, sums, strict=True)
    content = content or {}
    return [(f, _bytes(f, wanted, largest_megabyte, content.get(f))) for f, wanted in pairs]


def single(files, sha256, largest_megabyte=None, content=None) -> tuple[str, bytes]:
    """(path, bytes) of a test that is one file.

    Raises
    ------
    Refusal
        As `contents`, and where the sheet joins several files.
    """
    several = contents(files, sha256, largest_megabyte, content)
    if len(several) > 1:
        raise Refusal(f"{len(files)} files are joined ({';'.join(files)}); a spectrum is one file")
    return several[0]


def _bytes(file, wanted, largest_megabyte, content):
    digest, length = content or (None, None)
    opener = partial(_Unchanged, length=length)
    try:
        data = gate.content_at(
            file, within=CAMPAIGN, largest_megabyte=largest_megabyte, opener=opener
        )
    except Refusal as reason:
        if content is None:
            raise
        raise Changed(f"{reason}; it was readable when this run was planned") from None
    if not isinstance(data, bytes):
        return _of_checksum(data, file, wanted, digest)
    # Of the bytes that are used: a file may change between a look at it and its reading.
    data = data[:length]
    _refuse_other(file, hashlib.sha256(data).hexdigest(), wanted, digest)
    if not data:
        raise Refusal(f"{file}: the file is empty (0 bytes)")
    return data


def _of_checksum(opened, file, wanted, planned_with):
    """The open file, of which what is read is what the checksum was made of."""
    if wanted or planned_with:
        found = hashlib.file_digest(opened, "sha256").hexdigest()
        _refuse_other(file, found, wanted, planned_with)
    opened.seek(0)
    return opened


def _refuse_other(file, checksum, wanted, planned_with):
    if planned_with and checksum != planned_with:
        raise Changed(
            f"{file} was replaced while the run went on: SHA-256 is {checksum}, and was "
            f"{planned_with} when the run was planned; start it again"
        )
    if wanted and checksum != wanted.lower():
        raise Refusal(f"{file}: SHA-256 is {checksum}, tests.tsv says {wanted}")


class _Unchanged(io.FileIO):
    """A file that must not be written to after it was opened; with a length, only as far as that.

    What is written behind the length changes nothing of what is read.
    """

    def __init__(self, path, mode="rb", length=None, **how):
        super().__init__(path, mode, **how)
        self.length = length
        self.version = self._version()

    def _version(self):
        about = os.fstat(self.fileno())
        grown = self.length is not None and about.st_size > self.length
        return () if grown else (about.st_size, about.st_mtime_ns)

    def seek(self, offset, whence=0):
        if whence == 2 and self.length is not None:
            offset, whence = self.length + offset, 0
        return super().seek(offset, whence)

    def readinto(self, buffer):
        view = memoryview(buffer).cast("B")
        left = len(view) if self.length is None else max(0, self.length - self.tell())
        found = super().readinto(view[:left])
        if not found and self._version() != self.version:
            raise Changed(f"{self.name}: the file was written to while it was read; start again")
        return found
