"""What all cells of a type show, and what one cell shows alone: a matrix of cells and effects."""

from typing import NamedTuple

from cellwright.effects.floor import excess_volt
from cellwright.effects.story.messages import say
from cellwright.effects.story.words import doubts, name_of_effect

SHOWN = ("sure", "unsure", "or another")
FEW = 3  # so many cells are told by their names, more by their number


class Entry(NamedTuple):
    """One effect in one cell of a type.

    type, cell, effect : their names. shown : "sure"; "unsure", where something speaks against it or
    it explains a part of what is left unknown; "or another", where it is one of the names of a tie
    that another was chosen from; "not testable"; "no". size_volt : root mean square of what it
    takes off the error on validation records, else on those fitted; None where it is not shown [V].
    """

    type: str
    cell: str
    effect: str
    shown: str
    size_volt: float | None


class Fleet(NamedTuple):
    """Cells of each type beside each other.

    entries : tuple of Entry, of every cell and every effect that a cell of its type shows.
    sentences : dict type → what all show, and who shows what alone.
    """

    entries: tuple
    sentences: dict


def fleet(verdicts, types, witnesses=()):
    """Which effect all cells of a type share, and which cell has one alone.

    Parameters
    ----------
    verdicts : sequence of dict of the contract, one a cell. types : dict cell → name of its type;
    cells that are not in it, and types of one cell, are not compared.
    witnesses : sequence of dict with cell, effect, name, says, shown, see `doubts`.

    Returns
    -------
    fleet : Fleet.
    """
    of_type = {}
    for verdict in verdicts:
        if verdict["cell"] in types:
            of_type.setdefault(types[verdict["cell"]], []).append(verdict)
    entries, sentences = [], {}
    for name, cells in of_type.items():
        if len(cells) < 2:
            continue
        rows = _of_type(name, cells, witnesses)
        sentences[name] = _sentence(rows, cells)
        entries += rows
    return Fleet(tuple(entries), sentences)


def _of_type(name, verdicts, witnesses):
    """Entries of the cells of one type, effects that most cells show first."""
    shown = {v["cell"]: _shown(v, witnesses) for v in verdicts}
    many = {}
    for effects in shown.values():
        for effect in effects:
            many[effect] = many.get(effect, 0) + 1
    columns = sorted(many, key=lambda effect: (-many[effect], effect))
    entries = []
    for verdict in verdicts:
        untested = set(verdict["not_testable"])
        for effect in columns:
            absent = "not testable" if effect in untested else "no", None
            found = shown[verdict["cell"]].get(effect, absent)
            entries.append(Entry(name, verdict["cell"], effect, *found))
    return entries


def _shown(verdict, witnesses):
    """How each effect of a verdict is shown, and its size [V], by id."""
    shown = {}
    mine = [row for row in witnesses if row["cell"] == verdict["cell"]]
    for one in verdict["effects"]:
        against = doubts(one, [row for row in mine if row["effect"] == one["effect"]])
        shown[one["effect"]] = "unsure" if against else "sure", _size_volt(one)
    # What looks like something outside the vocabulary does not show the name that comes nearest.
    nearest = [] if verdict.get("outside") else verdict.get("partial", [])
    for one in nearest:
        shown[one["effect"]] = "unsure", _size_volt(one)
    tied = [name for one in verdict["effects"] for name in one["alternatives"]]
    return dict.fromkeys(tied, ("or another", None)) | shown


def _size_volt(one):
    """What an effect takes off the error, of validation records where it shows there [V]."""
    key = "rmse_volt" if one.get("proof") == "unproven" else "validation_rmse_volt"
    return excess_volt(one[key]["before"], one[key]["after"])


def _sentence(entries, verdicts):
    """What all cells of a type show, what some do, and who shows what alone; one sentence."""
    cells = {v["cell"]: set() for v in verdicts}
    by_effect = {}
    for entry in entries:
        if entry.shown in SHOWN:
            cells[entry.cell].add(entry.effect)
            by_effect.setdefault(entry.effect, []).append(entry)
    count = len(cells)
    shared = [_with_doubt(e, rows) for e, rows in by_effect.items() if len(rows) == count]
    code = "fleet.both" if count == 2 else "fleet.all"
    parts = [say(code, count=count, effects=", ".join(shared))] if shared else []
    for effect, rows in by_effect.items():
        about = {"effect": _with_doubt(effect, rows), "count": count}
        if 1 < len(rows) < count:
            parts.append(say("fleet.some", who=_listed([row.cell for row in rows]), **about))
    for effect, rows in by_effect.items():
        if len(rows) == 1:
            parts.append(say("fleet.alone", cell=rows[0].cell, effect=_with_doubt(effect, rows)))
    parts = parts or [say("fleet.none", count=count)]
    unknown = [v["cell"] for v in verdicts if v["verdict"] == "unknown"]
    parts += [say("fleet.unknown", who=_listed(unknown))] if unknown else []
    return "; ".join(parts)


def _with_doubt(effect, entries):
    name, unsure = name_of_effect(effect), sum(entry.shown != "sure" for entry in entries)
    if not unsure:
        return name
    code = "fleet.unsure" if unsure == len(entries) else "fleet.unsure_in"
    return say(code, effect=name, count=unsure)


def _listed(names):
    return ", ".join(names) if len(names) <= FEW else str(len(names))
