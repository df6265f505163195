"""Compressed bytes → the bytes they hold, told apart by their first bytes, never by a name."""

from ..refusal import Refusal

GZIP = b"\x1f\x8b"
ZSTANDARD = b"\x28\xb5\x2f\xfd"


def unpacked(data: bytes) -> bytes:
    """The content of a gzip or Zstandard file; anything else is handed back as it is.

    Raises
    ------
    Refusal
        No byte at all, or the compressed file is cut off or damaged.
    """
    if not data:
        raise Refusal("the file is empty (0 bytes)")
    if data.startswith(GZIP):
        return _gunzipped(data)
    if data.startswith(ZSTANDARD):
        return _unzstandard(data)
    return data


def _gunzipped(data: bytes) -> bytes:
    import gzip
    import zlib

    try:
        return gzip.decompress(data)
    except EOFError:
        raise Refusal(f"the gzip file is cut off after {len(data)} bytes") from None
    except (zlib.error, gzip.BadGzipFile) as fault:
        raise Refusal(f"the gzip file is damaged: {fault}") from None


def _unzstandard(data: bytes) -> bytes:
    import io

    import zstandard

    try:
        with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)) as stream:
            content = stream.read()
    except zstandard.ZstdError as fault:
        raise Refusal(f"the Zstandard file is damaged: {fault}") from None
    expected = zstandard.get_frame_parameters(data).content_size
    if expected not in (zstandard.CONTENTSIZE_UNKNOWN, len(content)):
        raise Refusal(f"the Zstandard file is cut off: {len(content)} of {expected} bytes")
    return content
