"""A figure as SVG text: laid out and drawn once, and written as short as its drawing allows."""

import re

import numpy as np

from figures import canvas

PARTS_PER_POINT = 10  # a coordinate is a tenth of a point, about a tenth of a pixel in the report
# Texts were measured in the first; where a reader has none of them, in any font without serifs.
FEW = 40  # numbers of a stretch of lines, up to which numpy takes longer than it saves
FONTS = "text{font-family:'DejaVu Sans',Verdana,Arial,sans-serif}"
NUMBERED = r'<g id="[a-zA-Z.]+2?d?_\d+">'  # matplotlib's groups, which nothing refers to


def text_of(figure, *, description: str) -> str:
    """SVG text of a figure with a description in its metadata; no date, so always the same."""
    about = {"Date": None, "Creator": "Cellwright", "Description": description}
    return shortened(canvas.drawn(figure, metadata=about))


def shortened(text: str) -> str:
    """The same drawing in fewer characters: its coordinates rounded to a tenth of a point.

    Lines are written as steps from point to point, which are short numbers, each from the rounded
    point before, so that nothing adds up; points that round to the same place are written once.
    Looks that recur are written once as classes.
    """
    head, found, body = text.partition("</metadata>")
    body = re.sub(r' d="([^"]*)"', _short_path, body)
    body = re.sub(r'( (?:x|y|width|height))="(-?[\d.]+)"', _short_place, body)
    body = re.sub(r' transform="rotate\(-?0 [^"]*\)"', "", body)
    body = re.sub(r' transform="[^"]*"', _short_transform, body)
    body = re.sub(NUMBERED, "<g>", body)
    body = re.sub(r"<!--.*?-->", "", body, flags=re.S)
    body = re.sub(r">\s+<", "><", body)
    body = re.sub(r"<g></g>|<defs></defs>", "", body)
    return re.sub(r"\s*\n\s*", " ", head) + found + _with_classes(body) + "\n"


def _short_path(match):
    """A path: relative lines where it has only lines, else its numbers rounded."""
    path = match[1]
    # Curves keep absolute numbers: control points are not steps from the point before.
    if re.search("[CQ]", path):
        closed_up = re.sub(r"\s*([MLCQz])\s*", r"\1", _rounded(path)).strip()
        return f' d="{closed_up}"'
    pieces = [_short_line(piece) for piece in path.split("M") if piece.strip()]
    return f' d="{"".join(pieces)}"'


def _short_transform(match):
    # A matrix has shares among its numbers, which a tenth would spoil.
    return match[0] if "matrix" in match[0] else _rounded(match[0])


def _rounded(text):
    """A text with all its numbers rounded to tenths."""
    return re.sub(r"-?\d[\d.]*(?:e-?\d+)?", lambda n: _short(_part(n[0])), text)


def _short_line(piece):
    """One stretch of lines, from its first point on; `z` where it closes."""
    closed = "z" if "z" in piece else ""
    numbers = piece.replace("L", " ").replace("z", " ").split()
    first, steps = (_steps_of_few if len(numbers) <= FEW else _steps_of_many)(numbers)
    start = f"M{_joined(first)}"
    return f"{start}l{_joined(steps)}{closed}" if steps else f"{start}h0{closed}"


def _steps_of_few(numbers):
    """First point and steps to the next ones [tenths of a point] without those of no length."""
    parts = [_part(number) for number in numbers]
    steps = [b - a for a, b in zip(parts, parts[2:], strict=False)]
    pairs = zip(steps[::2], steps[1::2], strict=True)
    return parts[:2], [part for pair in pairs if any(pair) for part in pair]


def _steps_of_many(numbers):
    """As `_steps_of_few`."""
    points = np.rint(np.array(numbers, dtype=float) * PARTS_PER_POINT).astype(int).reshape(-1, 2)
    steps = np.diff(points, axis=0)
    return points[0].tolist(), steps[steps.any(axis=1)].ravel().tolist()


def _part(number):
    return round(float(number) * PARTS_PER_POINT)


def _short_place(match):
    return f'{match[1]}="{_short(_part(match[2]))}"'


def _short(parts) -> str:
    """A number of tenths without what a reader of SVG does not need: `.5`, `-3`, `12.3`."""
    whole, tenth = divmod(abs(parts), PARTS_PER_POINT)
    digits = f"{whole or ''}.{tenth}" if tenth else f"{whole}"
    return f"-{digits}" if parts < 0 else digits


def _joined(parts) -> str:
    """Numbers one after the other, a space only where the next does not begin with its sign."""
    return " ".join(map(_short, parts)).replace(" -", "-")


def _with_classes(body):
    """Looks of elements as classes of one style sheet."""
    looks = {}

    def named(match):
        look = re.sub(r"([:;,]) ", r"\1", re.sub(r"font-family: [^;]*;? ?", "", match[1]))
        return f' class="{looks.setdefault(look, f"s{len(looks)}")}"'

    body = re.sub(r' style="([^"]*)"', named, body)
    sheet = "".join(f".{name}{{{look}}}" for look, name in looks.items())
    return body.replace("</style>", f"{FONTS}{sheet}</style>", 1)
