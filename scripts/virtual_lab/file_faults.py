"""What goes wrong with whole files on their way from the instrument: bytes in, bytes out.

Each gives the spoiled bytes and a row that says what was done, as in `faults`. A file spoiled in
one of these ways is beyond use; only the message about it can be good or bad.
"""

import gzip

import numpy as np

GZIP = b"\x1f\x8b"
HEADER_LINES = 40

Spoiled = tuple[bytes, list[dict]]


def cut_off(content: bytes, *, share: float = 0.6) -> Spoiled:
    """A file whose copying ended early; listed is how many bytes are left."""
    left = int(share * len(content))
    return content[:left], _listed("cut_off", left)


def emptied(content: bytes) -> Spoiled:
    """A file of no bytes; listed is how many there were."""
    return b"", _listed("emptied", len(content))


def header_only(content: bytes, *, lines: int = 1) -> Spoiled:
    """A test that never began: the first lines and no row; listed is how many lines are left."""
    text = _unpacked(content).splitlines(keepends=True)[:lines]
    return _as_before(content, b"".join(text)), _listed("header_only", len(text))


def damaged(content: bytes, *, seed: int, count: int = 8) -> Spoiled:
    """Single bytes changed in the last half, as a failing disk does; listed is the first place."""
    random = np.random.default_rng(seed)
    places = len(content) // 2 + random.choice(len(content) // 2, count, replace=False)
    changed = np.frombuffer(content, np.uint8).copy()
    changed[places] ^= random.integers(1, 256, count, dtype=np.uint8)
    return changed.tobytes(), _listed("damaged", int(places.min()))


def torn_row(content: bytes, *, seed: int) -> Spoiled:
    """A row of text that ends in the middle, the next one following; listed is its line from 1."""
    random = np.random.default_rng(seed)
    lines = _unpacked(content).splitlines(keepends=True)
    number = int(random.integers(min(HEADER_LINES, len(lines) // 2), len(lines) - 1))
    lines[number] = lines[number][: len(lines[number]) // 2] + b"\n"
    return _as_before(content, b"".join(lines)), _listed("torn_row", number + 1)


def _unpacked(content):
    return gzip.decompress(content) if content.startswith(GZIP) else content


def _as_before(content, changed):
    """Packed again where it was packed."""
    return gzip.compress(changed, mtime=0) if content.startswith(GZIP) else changed


def _listed(fault, value) -> list[dict]:
    return [{"fault": fault, "row": "", "value": value}]
