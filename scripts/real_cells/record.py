"""The record: numbers on which people agreed, beside the page that shows them."""

from pathlib import Path

import pandas as pd

from real_cells.gather import COLUMNS, KEYS
from real_cells.quantities import QUANTITIES

DOCS = Path(__file__).resolve().parents[2] / "docs"
FOLDER = DOCS / "real-cells"
RECORDED, BEFORE = FOLDER / "recorded.csv", FOLDER / "before.csv"
PUBLISHED, RENEWALS = FOLDER / "published.csv", FOLDER / "renewals.md"
PAGE = DOCS / "real-cells.md"
HEAD = """\
# Renewals of the record of real cells

Why the numbers of [recorded.csv](recorded.csv) and [before.csv](before.csv) were renewed, the
newest last. Made by scripts/tools/real_record.py. `code` is the hash of all code of the pipeline,
where the numbers are from a run of its own.

"""
TOLERANCES = ["tolerance_absolute", "tolerance_relative"]


def read(path) -> pd.DataFrame:
    """A table of numbers as text; none where there is no file yet."""
    if not Path(path).is_file():
        return pd.DataFrame(columns=COLUMNS, dtype=str)
    return pd.read_csv(path, dtype=str, keep_default_na=False)


def write(rows: pd.DataFrame, path):
    """Write a table of numbers as CSV."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(rows.to_csv(index=False, lineterminator="\n"), encoding="utf-8")


def renewed(recorded: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """The record with the measured campaigns in place of what it had of them.

    A tolerance that a person edited stays; blank ones are filled by the rule.
    """
    edited = recorded[[*KEYS, *TOLERANCES]].rename(
        columns=lambda name: name.replace("tol", "old_tol")
    )
    rows = measured.merge(edited, on=KEYS, how="left").fillna("")
    for name in TOLERANCES:
        rows[name] = rows[f"old_{name}"].where(rows[f"old_{name}"] != "", rows[name])
    kept = recorded[~recorded["campaign"].isin(measured["campaign"])]
    together = pd.concat([kept, rows[COLUMNS]], ignore_index=True)
    return together.sort_values("campaign", kind="stable", ignore_index=True)


def faults(recorded: pd.DataFrame) -> list[str]:
    """What is wrong with a record, such as an edited tolerance that is no number."""
    found = []
    for number, row in enumerate(recorded.to_dict("records"), 2):
        if row["quantity"] not in QUANTITIES:
            found.append(f"line {number}: found quantity {row['quantity']!r}, wanted a known one")
        found += [
            f"line {number}, {name}: found {row[name]!r}, wanted a number from 0"
            for name in TOLERANCES
            if not pd.to_numeric(row[name], errors="coerce") >= 0
        ]
    for row in recorded[recorded.duplicated(KEYS)].to_dict("records"):
        found.append(f"{' / '.join(row[key] for key in KEYS)}: stands twice")
    return found


def reasoned(why: str) -> str:
    """The reason of a renewal, in one line.

    Raises
    ------
    ValueError
        Where it says nothing.
    """
    reason = " ".join((why or "").split())
    if len(reason.split()) < 3:
        raise ValueError(
            f"found the reason {reason!r}, wanted a sentence that says why: --why '...'"
        )
    return reason


def note(reason: str, recorded: pd.DataFrame, measured: pd.DataFrame, *, of: str, code: str) -> str:
    """A line of the list of renewals: why, by which code, which campaigns, how many changes.

    Parameters
    ----------
    reason : why. recorded, measured : tables of numbers. of : name of the table, such as before.
    code : hash of the code that measured; "" where it is not known.
    """
    both = measured.merge(recorded, on=KEYS, how="left", suffixes=("", "_old"))
    checked = both[both["better"] != "shown"]
    changed = int((checked["value"] != checked["value_old"].fillna("")).sum())
    campaigns = ", ".join(measured["campaign"].unique())
    told = f"{campaigns}: {changed} of {len(checked)} numbers new or changed"
    return f"* {of}: {reason} ({told}{f'; code {code}' if code else ''})\n"


def renew(measured: pd.DataFrame, reason: str, path=RECORDED, *, code: str = ""):
    """Put measured numbers into the record (or `before`), and why at the end of the renewals."""
    recorded = read(path)
    line = note(reason, recorded, measured, of=path.stem, code=code)
    write(renewed(recorded, measured), path)
    written = RENEWALS.read_text(encoding="utf-8") if RENEWALS.is_file() else HEAD
    RENEWALS.write_text(written + line, encoding="utf-8")


def last_reason(of: str) -> str:
    """Why a table was last renewed, with what stands behind it in brackets; "" where never."""
    lines = RENEWALS.read_text(encoding="utf-8").splitlines() if RENEWALS.is_file() else []
    mine = [line.partition(": ")[2] for line in lines if line.startswith(f"* {of}: ")]
    return mine[-1] if mine else ""
