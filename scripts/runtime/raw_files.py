"""Raw files of a test: read whole, held against the checksums of the sheet."""

import hashlib

from cellwright import gate
from cellwright.refusal import Refusal

CAMPAIGN = "."  # jobs run in its folder


def readable(files, largest_megabyte=None) -> list[str]:
    """Those of some files, paths relative to the campaign, that the gate opens.

    They are the inputs of a job. What another one is the job itself says, and loses nothing else.
    """
    return [file for file in files if not gate.obstacle(file, CAMPAIGN, largest_megabyte)]


def contents(files, sha256, largest_megabyte=None) -> list[tuple[str, bytes]]:
    """(path, bytes) of each file of a test, in order.

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


def _bytes(file, wanted, largest_megabyte) -> bytes:
    data = gate.contents(file, within=CAMPAIGN, largest_megabyte=largest_megabyte)
    if not data:
        raise Refusal(f"{file}: the file is empty (0 bytes)")
    # Of the bytes that are used: a file may change between a look at it and its reading.
    checksum = hashlib.sha256(data).hexdigest()
    if wanted and checksum != wanted.lower():
        raise Refusal(f"{file}: SHA-256 is {checksum}, tests.tsv says {wanted}")
    return data
