"""What kind of bytes a file holds: compressed ones unpacked, foreign ones recognised by sight."""

from cellwright.refusal import Refusal

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


# First bytes, and what a file that begins so is. Order matters where one begins like another.
BEGINNINGS = (
    (b"BIO-LOGIC MODULAR FILE", "a BioLogic mpr file"),
    (b"EC-Lab ASCII FILE", "a BioLogic EC-Lab text file"),
    (b"BT-Lab ASCII FILE", "a BioLogic BT-Lab text file"),
    (b"mode\tox/red", "a BioLogic text file without its header"),
    (b"NEWARE", "a Neware nda file"),
    (b"DataPoint,Cycle Index", "a Neware csv file"),
    (b"Cycle Index,Chg. Cap.", "a Neware report csv file"),
    (b"\x00\x01\x00\x00Standard Jet", "an Arbin res file (a Jet data base)"),
    (b"\x00\x01\x00\x00Standard ACE", "an Arbin res file (an ACE data base)"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB mat file"),
    (b"\x89HDF\r\n", "an HDF5 file (such as MATLAB 7.3)"),
    (b"Today's Date", "a Maccor export"),
    (b"MACCOR", "a Maccor file"),
    (b"Name:\t", "a Maccor text file"),
    (b"[Summary]", "a Novonix csv file"),
    (b"~Resultfile from Basytec", "a BaSyTec text file"),
    (b"cell model:", "a Landt csv file"),
    (b"Request Year:", "a PEC csv file"),
    (b"EXPLAIN", "a Gamry DTA file"),
    (b"ZPLOT2", "a ZPlot file"),
    (b'"ZPlotW', "a ZPlot file"),
    (b'"Z60W', "an Autolab impedance text"),
    (b"<Application>", "a VersaStudio par file"),
    (b"\x00\x00\xff\xff\xff", "a Zahner ism file"),
    (b"ARROW1", "an Arrow (Feather) file"),
    (b"\xd0\xcf\x11\xe0", "an old Office file (xls)"),
    (b"%PDF", "a PDF file"),
    (b"<?xml", "an XML file"),
    (b"\xff\xfe", "UTF-16 text; export it as UTF-8"),
    (b"\xfe\xff", "UTF-16 text; export it as UTF-8"),
    (b"\x89PNG", "a picture"),
)
# What a zip archive holds tells whose it is.
ARCHIVES = (
    (b".ndc", "a Neware ndax file"),
    (b"VersionInfo.xml", "a Neware ndax file"),
)


def sight(data: bytes) -> str | None:
    """What a file without a reader is, as a noun phrase; None where it is not known."""
    if data.startswith(b"PK\x03\x04"):
        return next((what for mark, what in ARCHIVES if mark in data), "a zip archive")
    head = data[:64].removeprefix(b"\xef\xbb\xbf")
    return next((what for mark, what in BEGINNINGS if head.startswith(mark)), None)
