"""Sizes of texts [point], each character measured once, and long texts broken into lines."""

from functools import lru_cache

from matplotlib.font_manager import FontProperties, findfont
from matplotlib.ft2font import FT2Font, LoadFlags

MEASURED_SIZE = 100.0  # point, at which a character is measured
LINE_HEIGHT, DESCENT = 1.2, 0.24  # of a line, as shares of the font size


@lru_cache(maxsize=2)
def _font(bold):
    weight = "bold" if bold else "normal"
    font = FT2Font(findfont(FontProperties(family="sans-serif", weight=weight)))
    font.set_size(MEASURED_SIZE, 72)
    return font


@lru_cache(maxsize=4096)
def _advance(character, bold):
    """Width of a character as a share of the font size."""
    glyph = _font(bold).load_char(ord(character), flags=LoadFlags.NO_HINTING)
    return glyph.linearHoriAdvance / 65536 / MEASURED_SIZE


def width(text: str, size: float, *, bold: bool = False) -> float:
    """Width [point] of a text at a font size [point]; of the widest where it has several lines."""
    lines = text.split("\n")
    return size * max(sum(_advance(character, bold) for character in line) for line in lines)


def height(text: str, size: float) -> float:
    """Height [point] of all lines of a text at a font size [point]; 0 without a text."""
    return LINE_HEIGHT * size * (text.count("\n") + 1) if text else 0.0


def wrapped(text: str, size: float, most: float, *, bold: bool = False) -> str:
    """The text in lines of at most `most` [point], broken at spaces, inside a word only if need be.

    `size` is the font size [point]. Every line has at least one character.
    """
    if width(text, size, bold=bold) <= most:
        return text
    return "\n".join(
        line for part in text.split("\n") for line in _lines(part, size, most, bold=bold)
    )


def _lines(text, size, most, *, bold):
    lines = [""]
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}".strip()
        if width(longer, size, bold=bold) <= most:
            lines[-1] = longer
        else:
            lines += _pieces(word, size, most, bold=bold)
    return [line for line in lines if line] or [""]


def _pieces(word, size, most, *, bold):
    """A word as it is where it fits into a line, else cut where the line ends."""
    pieces = [""]
    for character in word:
        if pieces[-1] and width(pieces[-1] + character, size, bold=bold) > most:
            pieces.append("")
        pieces[-1] += character
    return pieces
