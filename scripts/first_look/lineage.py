"""`explain TABLE ROW`: a row of a table, and what it was made from, down to the raw bytes."""

from contextlib import chdir
from pathlib import Path

from cellwright.refusal import Refusal
from runtime import artefact, lineage

DIGITS = 12  # of a checksum: enough to compare by eye


def explain(table, row) -> list[str]:
    """The row in words, then each file that it was made from, indented below what it made.

    Parameters
    ----------
    table : path of a CSV table of the results, such as results/tables/capacity.csv, or of another
        artefact, such as results/models/C1.json
    row : of a table, number of a line as a spreadsheet counts them (the header is 1), or
        `column=value` pairs; else nothing

    Raises
    ------
    Refusal : no such table or row, several rows, or a table without provenance.
    """
    path = Path(table)
    folder = next((up.parent for up in path.absolute().parents if up.name == "results"), None)
    if folder is None or not path.is_file():
        found = (
            "no such file" if not path.exists() else "a folder" if path.is_dir() else "no result"
        )
        raise Refusal(f"{table}: found {found}, wanted a table below results/")
    name = path.absolute().relative_to(folder).as_posix()
    if path.suffix != ".csv":
        if row:
            raise Refusal(f"{table}: found the row {' '.join(row)}, wanted none: it is no table")
        values, said = {}, [name]
    else:
        line, values = _row_of(path, row)
        said = [f"{name}, line {line}"]
        said += [f"  {column}: {value}" for column, value in values.items() if value]
    with chdir(folder):
        links = lineage.links_to(name, lambda source: _is_about(source, values))
        if links[0].about is None:
            raise Refusal(f"{table}: found nothing in or beside it of what it was made from")
        shown = [_in_words(link, values) for link in links if not link.repeated]
    more = len(links) - len(shown)
    again = [f"{more} further uses of files named above are not repeated"] if more else []
    return [*said, "made from", *shown, *again]


def _row_of(path, wanted) -> tuple[int, dict]:
    rows = dict(enumerate(artefact.load_table(path), 2))
    if len(wanted) == 1 and wanted[0].isdigit():
        line = int(wanted[0])
        if line not in rows:
            raise Refusal(f"{path}: found no line {line}, wanted one of 2 to {len(rows) + 1}")
        return line, rows[line]
    if not wanted:
        raise Refusal(f"{path}: found no row, wanted the number of a line, such as 2")
    pairs = [pair.split("=", 1) for pair in wanted]
    columns = list(next(iter(rows.values()), {}))
    if bad := [pair[0] for pair in pairs if len(pair) != 2 or pair[0] not in columns]:
        raise Refusal(
            f"{path}: row: found {bad[0]!r}, wanted the number of a line or COLUMN=VALUE of "
            f"{', '.join(columns)}"
        )
    found = [line for line, row in rows.items() if all(row[key] == value for key, value in pairs)]
    if len(found) != 1:
        lines = f"{len(found)} lines ({', '.join(map(str, found[:8]))})" if found else "no line"
        raise Refusal(f"{path}: found {lines} with {' '.join(wanted)}, wanted one")
    return found[0], rows[found[0]]


def _is_about(source, row) -> bool:
    """Whether an input of a table may have given a row: it is of its cell, and of its test."""
    of = [row.get("cell") or row.get("group"), row.get("test")]
    names = Path(source).with_suffix("").parts[2:]
    if of[1] and (names[-2:] == tuple(of) or names[-1] == of[0]):
        return True
    return not of[1] and (of[0] is None or of[0] in names or source.endswith(".csv"))


def _speaks_of(owner, row) -> bool:
    """Whether a doubt of an owner, "cell test", is one of a row."""
    cell, _, test = owner.partition(" ")
    of = row.get("cell") or row.get("group")
    return not of or (cell == of and (not test or row.get("test") in (None, "", test)))


def _in_words(link, row) -> str:
    about, indent = link.about, "  " * (link.depth + 1)
    what = [link.path]
    if link.sha256:
        what.append(f"sha256 {link.sha256[:DIGITS]}")
    what.append(lineage.state_of(link))
    if about is None:
        what.append("" if link.path.startswith("results/") else "raw file or sheet")
    else:
        what.append(f"by rule {about['rule']}, code {about['code']}")
        # A table has those of all its rows.
        whole = Path(link.path).suffix != ".csv"
        doubts = about.get("doubts", {}).items()
        what += [f"doubt: {said}" for of, said in doubts if whole or _speaks_of(of, row)]
    return indent + ", ".join(filter(None, what))
