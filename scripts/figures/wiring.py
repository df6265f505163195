"""A group's wiring as its sheet states it, drawn as a circuit, its cells coloured by their bias."""

from itertools import pairwise
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.patches import Rectangle

from cellwright.packs.wiring import cells_of, described, wiring_of
from cellwright.records.basis import REFERENCE_CELSIUS, stated_or_reference
from figures import style
from figures.models import resistance_after

BOX, LEAD, ROW = (1.15, 0.66), 0.16, 0.86  # units of the drawing: a cell, its leads, its height
RESISTOR = 0.3
ACROSS, DOWN = 17.0, 10  # widest row of members in series; most members in a column in parallel
POINT_PER_UNIT = 44.0  # of a drawing that is not too wide for it
SECOND, MIDDLE_SOC = 10.0, 0.5  # at which resistances are compared
LEAST_RANGE = 0.02  # of the colours: a bias of less than this is pale
SENSE = style.SERIES[3]


class Block(NamedTuple):
    """A placed part of a circuit: its size, the heights of its two ends, and what is drawn.

    marks : list of (kind, points (k, 2), what it says): a "line"; of one point a "resistor", which
    may stand upright, a "sense", and a "cell" or a "word" with its text.
    """

    width: float
    height: float
    enters: float
    leaves: float
    marks: list


def _mark(kind, *points, says=None):
    return kind, np.array(points, float), says


def draw_wiring(group, rows, models):
    """Wiring of a group, its cells coloured by capacity and by resistance against the mean.

    `rows` are those of groups.tsv of the group and of all groups in it, `models` the contents of
    the model files of its cells, as many as there are.
    """
    wiring = wiring_of(group, rows)
    block = _placed(wiring)
    capacity = {model["cell"]: model["capacity_ampere_hour"] for model in models}
    compared = [_resistance(model) for model in models]
    resistance = {model["cell"]: ohm for model, (_, ohm) in zip(models, compared, strict=True)}
    beside = 2 * block.width <= 1.6 * ACROSS
    unit = min(POINT_PER_UNIT, 620.0 / ((2.1 if beside else 1.0) * (block.width + 0.8))) / 72.0
    high = (block.height + 0.8) * unit + 0.35
    grid = (1, 2) if beside else (2, 1)
    figure, axes = style.subplots(*grid, width=9.0, height=(1 if beside else 2) * high + 0.3)
    panels = axes.flat
    celsius = sorted({celsius for celsius, _ in compared})
    what = f"resistance, {SECOND:g} s, {100 * MIDDLE_SOC:g} % SoC{_temperatures(celsius)}"
    for value, name, size, less in (
        (capacity, "capacity", "{:.3g} Ah", -1),
        (resistance, what, "{:.3g} mΩ", 1),
    ):
        _panel(next(panels), block, _bias(value, cells_of(wiring)), worse=less, unit=unit * 72)
        known = [value[cell] for cell in cells_of(wiring) if cell in value]
        mean = size.format((1e3 if "m" in size else 1) * np.mean(known)) if known else "not known"
        axes.flat[0 if less < 0 else 1].set_title(f"Bias of {name} (mean {mean})")
    figure.suptitle(described(wiring), x=0.01, ha="left", fontsize=9)
    return figure


def _resistance(model):
    """Temperature nearest 25 °C [°C], and the chosen member's resistance there [Ω].

    The resistance is that some seconds after a small step of the current.
    """
    member = next(m for m in model["members"] if m["model"] == model["chosen"])
    stated = [stated_or_reference(c["ambient_temperature_celsius"]) for c in member["conditions"]]
    celsius = min(stated, key=lambda celsius: abs(celsius - REFERENCE_CELSIUS))
    at = member["conditions"][stated.index(celsius)]
    return celsius, float(np.interp(MIDDLE_SOC, at["soc"], resistance_after(at, SECOND)))


def _temperatures(celsius):
    """Words for the temperatures [°C], ascending, at which the cells' resistances were taken."""
    if not celsius:
        return ""
    return (
        f", {celsius[0]:g} °C" if len(celsius) == 1 else f", {celsius[0]:g} to {celsius[-1]:g} °C"
    )


def _bias(value, cells):
    """Each cell's difference from the mean of those known, over that mean."""
    known = [value[cell] for cell in cells if cell in value]
    mean = np.mean(known) if known else np.nan
    return {cell: value[cell] / mean - 1.0 for cell in cells if cell in value}


def _placed(part, contact=0.0, *, sensed=False):
    """A part of a wiring with its contact, as a block."""
    if isinstance(part, str):
        block = _cell(part)
    else:
        block = _series(part) if part.connection == "series" else _parallel(part)
    if sensed:
        ends = [(LEAD / 2, block.enters), (block.width - LEAD / 2, block.leaves)]
        block = block._replace(marks=block.marks + [_mark("sense", end) for end in ends])
    return _with_contact(block) if contact else block


def _cell(name):
    width, y = BOX[0] + 2 * LEAD, ROW / 2
    leads = [_mark("line", (x, y), (x + LEAD, y)) for x in (0, width - LEAD)]
    return Block(width, ROW, y, y, [*leads, _mark("cell", (width / 2, y), says=name)])


def _with_contact(block):
    wide, y = RESISTOR + LEAD, block.enters
    contact = [
        _mark("line", (0, y), (wide, y)),
        _mark("resistor", (LEAD / 2 + RESISTOR / 2, y), says=False),
    ]
    moved = _moved(block, wide, 0.0)
    return moved._replace(width=block.width + wide, marks=moved.marks + contact)


def _moved(block, x, y):
    """The same block, drawn elsewhere."""
    marks = [(kind, points + (x, y), says) for kind, points, says in block.marks]
    return block._replace(enters=block.enters + y, leaves=block.leaves + y, marks=marks)


def _joined(blocks, more=(), **sizes):
    """What several placed blocks draw, and further marks, as one block."""
    return Block(**sizes, marks=[*(mark for block in blocks for mark in block.marks), *more])


def _members(wiring):
    pairs = zip(wiring.members, wiring.contact_ohm, strict=True)
    return [_placed(m, r, sensed=k == wiring.sense) for k, (m, r) in enumerate(pairs)]


def _series(wiring):
    """Members from left to right, in rows where they are many; y grows downwards."""
    rows = _in_rows(_members(wiring))
    # Rows end at one side, where the lead to the next begins.
    widest = max(sum(block.width for block in row) for row in rows)
    placed, lines, top, end = [], [], 0.0, None
    for row in rows:
        axis = top + max(block.enters for block in row)
        lines += [_return(end, (0.0, axis), widest, top)] if end else []
        x = 0.0
        for block in row:
            placed.append(_moved(block, x, axis - block.enters))
            x += block.width
        end = (x, axis)
        lowest = max(axis - block.enters + block.height for block in row)
        top = lowest + (0.25 if len(rows) > 1 else 0.0)
    lines.append(_mark("line", end, (widest, end[1])))
    return _joined(placed, lines, width=widest, height=top, enters=placed[0].enters, leaves=end[1])


def _in_rows(blocks):
    """Blocks in rows that are not too wide, each leaving at the height at which it enters."""
    rows, width = [[]], 0.0
    for block in map(_levelled, blocks):
        if rows[-1] and width + block.width > ACROSS:
            rows.append([])
            width = 0.0
        rows[-1].append(block)
        width += block.width
    return rows


def _levelled(block):
    """A block whose last end is led back to the height of its first, where it is not there."""
    # Members of a row lie on one line, so that a string reads like one.
    if block.leaves == block.enters:
        return block
    x, y = block.width + LEAD, block.enters
    lead = (block.width, block.leaves), (x, block.leaves), (x, y), (x + LEAD, y)
    return block._replace(width=x + LEAD, leaves=y, marks=[*block.marks, _mark("line", *lead)])


def _return(end, start, widest, top):
    """The lead from the end of a row of members to the start of the next."""
    between = top - 0.12
    return _mark("line", end, (widest, end[1]), (widest, between), (0.0, between), start)


def _parallel(wiring):
    """Members below each other between two busbars, in columns where they are many."""
    blocks = _members(wiring)
    columns = -(-len(blocks) // DOWN)
    size = -(-len(blocks) // columns)
    parts, x = [], 0.0
    for first in range(0, len(blocks), size):
        links = wiring.link_ohm[first : first + size]
        column = _column(blocks[first : first + size], links)
        parts.append(_moved(column, x, 0.55 if columns > 1 else 0.0))
        x += column.width + 0.35
    high = max(part.height for part in parts) + (0.9 if columns > 1 else 0.0)
    last = parts[-1].leaves if wiring.terminals == "opposite_ends" else parts[0].enters
    if not any(wiring.link_ohm):
        last = parts[0].enters
    whole = _joined(parts, width=x - 0.35, height=high, enters=parts[0].enters, leaves=last)
    if columns > 1 and any(wiring.link_ohm):
        return _ladder_of_columns(whole, parts, wiring)
    if columns > 1:
        return whole._replace(marks=whole.marks + _bars_between(parts, high))
    return whole


def _column(blocks, links):
    """One column of members with its two busbars, the last marks; resistors of links upon them."""
    gap = 0.45 if any(links) else 0.1
    right = max(block.width for block in blocks) + 2 * LEAD
    placed, marks, top = [], [], 0.0
    for k, (block, link) in enumerate(zip(blocks, links, strict=True)):
        top += gap if k else 0.0
        moved = _moved(block, LEAD, top)
        placed.append(moved)
        marks.append(_mark("line", (0.0, moved.enters), (LEAD, moved.enters)))
        marks.append(_mark("line", (LEAD + block.width, moved.leaves), (right, moved.leaves)))
        if link and k:
            marks += [_mark("resistor", (x, top - gap / 2), says=True) for x in (0.0, right)]
        top += block.height
    first, last = placed[0], placed[-1]
    marks.append(_mark("line", (0.0, first.enters), (0.0, last.enters)))
    marks.append(_mark("line", (right, first.leaves), (right, last.leaves)))
    return _joined(placed, marks, width=right, height=top, enters=first.enters, leaves=last.leaves)


def _bars_between(parts, high):
    """Leads that join the busbars of the columns of a star: left ones above, right ones below."""
    leads = []
    for bar, end, place in ((-2, 0, 0.0), (-1, 1, high)):
        at = [part.marks[bar][1][end] for part in parts]
        leads += [_mark("line", point, (point[0], place)) for point in at]
        leads.append(_mark("line", (at[0][0], place), (at[-1][0], place)))
    return leads


def _ladder_of_columns(whole, parts, wiring):
    """A ladder that goes on from column to column, by letters at the ends of its busbars."""
    marks = []
    # Drawn leads would cross the columns; two ends of one letter are one point.
    letters = iter("abcdefghijklmnopqrstuvwxyz")
    for part, following in pairwise(parts):
        for bar in (-2, -1):
            letter = next(letters, "…")
            (x, y), (a, b) = part.marks[bar][1][1], following.marks[bar][1][0]
            marks += [_mark("word", (x, y + 0.3), says=letter)]
            marks += [_mark("word", (a, b - 0.62), says=letter)]
            marks += [_mark("line", (x, y), (x, y + 0.18)), _mark("line", (a, b), (a, b - 0.5))]
            marks.append(_mark("resistor", (a, b - 0.25), says=True))
    if wiring.terminals == "same_end":
        (x, y), top = parts[0].marks[-1][1][0], -0.05
        marks.append(_mark("line", (x, y), (x, top), (whole.width, top)))
        whole = whole._replace(leaves=top)
    return whole._replace(marks=whole.marks + marks)


def _panel(axes, block, bias, *, worse, unit):
    """One drawing of the wiring, its cells coloured by a bias; `worse` is the sign of the bad."""
    axes.set(xticks=[], yticks=[], xlim=(-0.5, block.width + 0.4), ylim=(block.height + 0.1, -0.25))
    axes.set_aspect("equal", adjustable="box", anchor="NW")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    drawn = {}
    for kind, points, says in block.marks:
        drawn.setdefault(kind, []).append((points, says))
    for points, _ in drawn["line"]:
        axes.plot(*points.T, color=style.INK, lw=0.8, solid_capstyle="round")
    for ((x, y),), upright in drawn.get("resistor", ()):
        wide, tall = (0.13, RESISTOR * 0.8) if upright else (RESISTOR * 0.8, 0.13)
        look = {"facecolor": "white", "edgecolor": style.INK, "lw": 0.7, "zorder": 3}
        axes.add_patch(Rectangle((x - wide / 2, y - tall / 2), wide, tall, **look))
    if "sense" in drawn:
        senses = np.concatenate([points for points, _ in drawn["sense"]])
        axes.plot(*senses.T, "D", color=SENSE, ms=3.5, zorder=4)
    for x, y, sign in ((-0.28, block.enters, "−"), (block.width + 0.2, block.leaves, "+")):
        axes.text(x, y, sign, ha="center", va="center", fontsize=10, fontweight="bold")
    for ((x, y),), letter in drawn.get("word", ()):
        axes.text(x, y, letter, ha="center", va="center", fontsize=7, color=SENSE)
    # Cells that are nearly alike must not look like cells that differ.
    largest = max([LEAST_RANGE, *map(abs, bias.values())])
    longest = max(5, *(len(name) for _, name in drawn["cell"]))
    size = float(np.clip(min(0.17, 1.6 * BOX[0] / longest) * unit, 3.5, 8.0))
    for ((x, y),), name in drawn["cell"]:
        _box(axes, name, x, y, bias.get(name), worse / largest, size)


def _box(axes, name, x, y, bias, scale, size):
    share = 0.0 if bias is None else scale * bias
    fill = style.GRID if bias is None else matplotlib.colormaps["RdBu_r"](0.5 + 0.38 * share)
    corner = (x - BOX[0] / 2, y - BOX[1] / 2)
    axes.add_patch(Rectangle(corner, *BOX, facecolor=fill, edgecolor=style.INK, lw=0.7, zorder=3))
    said = "no model" if bias is None else f"{100 * bias:+.1f} %"
    ink = "white" if abs(share) > 0.8 else style.INK
    axes.text(x, y - 0.15, name, ha="center", va="center", fontsize=size, zorder=5, color=ink)
    axes.text(x, y + 0.16, said, ha="center", va="center", fontsize=size, zorder=5, color=ink)
