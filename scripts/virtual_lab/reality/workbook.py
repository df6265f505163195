"""Arbin's workbooks (.xlsx) as the text of the channel's sheet, for the reader of Arbin's CSV."""

import io
import re
import zipfile
from xml.etree import ElementTree

MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
RELATION = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"


def channel_csv(content: bytes) -> bytes:
    """The sheet whose name begins with `Channel`, numbers as they stand in the file.

    Office Open XML (ECMA-376, part 1, 18.3): rows of cells, texts in a table of their own.
    """
    book = zipfile.ZipFile(io.BytesIO(content))
    with book.open(_channel_path(book)) as sheet:
        lines = list(_lines(sheet, _texts(book)))
    return ("\n".join(lines) + "\n").encode()


def _channel_path(book: zipfile.ZipFile) -> str:
    sheets = ElementTree.fromstring(book.read("xl/workbook.xml")).iter(f"{MAIN}sheet")
    wanted = next(s.get(RELATION) for s in sheets if s.get("name", "").startswith("Channel"))
    links = ElementTree.fromstring(book.read("xl/_rels/workbook.xml.rels"))
    target = next(link.get("Target") for link in links if link.get("Id") == wanted)
    return target.lstrip("/") if target.startswith("/") else f"xl/{target}"


def _texts(book: zipfile.ZipFile) -> list[str]:
    if "xl/sharedStrings.xml" not in book.namelist():
        return []
    table = ElementTree.fromstring(book.read("xl/sharedStrings.xml"))
    return ["".join(part.text or "" for part in text.iter(f"{MAIN}t")) for text in table]


def _lines(sheet, texts):
    """One line a row; cells that the file leaves out stay blank."""
    for _, row in ElementTree.iterparse(sheet):
        if row.tag != f"{MAIN}row":
            continue
        cells = {_column(cell.get("r")): _value(cell, texts) for cell in row}
        if cells:
            yield ",".join(cells.get(number, "") for number in range(1, max(cells) + 1))
        row.clear()


def _column(reference: str) -> int:
    """Number of a column from a cell's address: A1 → 1, AB7 → 28."""
    number = 0
    for letter in re.match("[A-Z]+", reference)[0]:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number


def _value(cell, texts) -> str:
    value = cell.findtext(f"{MAIN}v") or ""
    return texts[int(value)] if cell.get("t") == "s" and value else value
