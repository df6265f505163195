"""The rooms of scripts/cellwright and what they import, as a table and a picture.

Both are made from the code: purposes from the rooms' docstrings, arrows from their imports.
"""

import ast
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCIENCE = ROOT / "scripts" / "cellwright"
WIDTH, HEIGHT, GAP_X, GAP_Y, MARGIN = 176, 72, 30, 40, 20
BESIDE = {"native", "settings"}  # serve every room: no arrows are drawn to them


def rooms() -> dict[str, str]:
    """Every room and its purpose: the first sentence of its docstring."""
    folders = sorted(path.parent for path in SCIENCE.glob("*/__init__.py"))
    return {folder.name: _purpose(folder) for folder in folders}


def _purpose(folder: Path) -> str:
    docstring = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))
    return docstring.splitlines()[0]


@cache
def imports() -> dict[str, set[str]]:
    """Which rooms each room imports."""
    names_of_rooms = set(rooms())
    needs = {room: set() for room in names_of_rooms}
    for room in names_of_rooms:
        for path in (SCIENCE / room).rglob("*.py"):
            tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            names = [node.module or "" for node in tree if isinstance(node, ast.ImportFrom)]
            parts = [name.split(".") for name in names if name.startswith("cellwright.")]
            needs[room] |= {part[1] for part in parts if part[1] in names_of_rooms} - {room}
    return needs


def levels(needs) -> dict[str, int]:
    """How many rooms stand below each room, one upon another.

    Raises ValueError where rooms import each other in a circle.
    """
    level = {}
    while len(level) < len(needs):
        ready = [room for room, below in needs.items() if room not in level and below <= set(level)]
        if not ready:
            rooms = ", ".join(sorted(set(needs) - set(level)))
            raise ValueError(f"rooms import each other in a circle: {rooms}")
        level |= {room: 1 + max((level[b] for b in needs[room]), default=-1) for room in ready}
    return level


def direct(needs) -> list[tuple[str, str]]:
    """The imports that no chain of other imports implies: what the picture draws."""

    def reached(room):
        below = needs[room] - BESIDE
        return below.union(*[reached(other) for other in below]) if below else set()

    return sorted(
        (room, below)
        for room in needs
        for below in needs[room] - BESIDE
        if not any(below in reached(other) for other in needs[room] - {below})
    )


def table() -> str:
    """The table of the rooms, lowest first."""
    needs, purposes = imports(), rooms()
    level = levels(needs)
    order = sorted(purposes, key=lambda room: (level[room], room))
    lines = ["| room | what is in it | imports |", "| --- | --- | --- |"]
    lines += [
        f"| `{room}` | {purposes[room]} "
        f"| {', '.join(sorted(needs[room], key=order.index)) or '–'} |"
        for room in order
    ]
    return "\n".join(lines)


def picture() -> str:
    """The rooms as an SVG: a room stands above all that it imports."""
    needs, purposes = imports(), rooms()
    level = levels(needs)
    rows = [[r for r in sorted(purposes) if level[r] == n] for n in range(max(level.values()) + 1)]
    widest = max(map(len, rows))
    width = widest * (WIDTH + GAP_X) - GAP_X + 2 * MARGIN
    height = len(rows) * (HEIGHT + GAP_Y) - GAP_Y + 2 * MARGIN
    corner = {}
    for number, row in enumerate(rows):
        start = (width - len(row) * (WIDTH + GAP_X) + GAP_X) / 2
        top = MARGIN + (len(rows) - 1 - number) * (HEIGHT + GAP_Y)
        corner |= {room: (start + k * (WIDTH + GAP_X), top) for k, room in enumerate(row)}
    arrows = "".join(_arrow(corner[room], corner[below]) for room, below in direct(needs))
    boxes = "".join(_box(room, purposes[room], corner[room]) for room in corner)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
        f'font-family="sans-serif" role="img">\n<title>The rooms of cellwright</title>\n'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="#8a94a0"/></marker></defs>\n'
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>\n{arrows}{boxes}</svg>\n'
    )


def _arrow(upper, lower) -> str:
    (x0, y0), (x1, y1) = upper, lower
    x0, x1, y0 = x0 + WIDTH / 2, x1 + WIDTH / 2, y0 + HEIGHT
    middle = (y0 + y1) / 2
    path = f"M{x0:g} {y0:g}C{x0:g} {middle:g} {x1:g} {middle:g} {x1:g} {y1 - 2:g}"
    return f'<path d="{path}" fill="none" stroke="#8a94a0" marker-end="url(#tip)"/>\n'


def _box(room, purpose, corner) -> str:
    x, y = corner
    words = [purpose.partition(":")[0].rstrip(".").split()]
    lines = [""]
    for word in words[0]:
        fits = len(lines[-1]) + len(word) < 30
        lines = [*lines[:-1], f"{lines[-1]} {word}".strip()] if fits else [*lines, word]
    text = "".join(
        f'<text x="{x + 10:g}" y="{y + 34 + 12 * k:g}" font-size="10" fill="#1d2733">'
        f"{escape(line)}</text>"
        for k, line in enumerate(lines[:3])
    )
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{WIDTH}" height="{HEIGHT}" rx="6" fill="#f4f7fa" '
        f'stroke="#0b6fb8"/><text x="{x + 10:g}" y="{y + 18:g}" font-size="13" '
        f'font-weight="bold" fill="#0b6fb8">{room}</text>{text}\n'
    )
