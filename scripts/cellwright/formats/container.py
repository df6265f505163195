"""What kind of bytes a file holds: compressed ones unpacked, foreign ones recognised by sight."""

from cellwright.refusal import Refusal

GZIP = b"\x1f\x8b"
ZSTANDARD = b"\x28\xb5\x2f\xfd"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")


def unpacked(data: bytes) -> bytes:
    """The content of a gzip or Zstandard file, and UTF-16 as UTF-8; all else as it is.

    Raises
    ------
    Refusal
        No byte at all, or the compressed file is cut off or damaged.
    """
    if not data:
        raise Refusal("the file is empty (0 bytes)")
    if data.startswith(GZIP):
        data = _gunzipped(data)
    elif data.startswith(ZSTANDARD):
        data = _unzstandard(data)
    return _utf_8(data) if data.startswith(UTF_16) else data


def _utf_8(data):
    try:
        return data.decode("utf-16").encode()
    except UnicodeDecodeError as fault:
        raise Refusal(f"the UTF-16 text is cut off or damaged: {fault}") from None


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
    if data.startswith(b"PK\x03\x04"):
        return "a zip archive"
    head = data[:64].removeprefix(b"\xef\xbb\xbf")
    return next((what for mark, what in BEGINNINGS if head.startswith(mark)), None)
