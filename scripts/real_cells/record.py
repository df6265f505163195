"""The record of numbers of real cells: how it is renewed, and how measured ones compare with it."""

from pathlib import Path

import pandas as pd

from real_cells.quantities import COLUMNS, KEYS, QUANTITIES

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
WORSE, MISSING, NEW, BETTER, SAME = "worse", "missing", "new", "better", "same"
FAILING = (WORSE, MISSING)
REMEDY = "./run python scripts/tools/real_record.py --why '...' records them"
HEADS = {
    WORSE: "Worse than recorded, beyond the tolerance",
    MISSING: "Recorded, and not found any more",
    BETTER: "Better than recorded: renew the record",
    NEW: "New, not recorded yet",
}


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


def faults_of(recorded: pd.DataFrame) -> list[str]:
    """What is wrong with a record, such as an edited tolerance that is no number."""
    faults = []
    for number, row in enumerate(recorded.to_dict("records"), 2):
        if row["quantity"] not in QUANTITIES:
            faults.append(f"line {number}: found quantity {row['quantity']!r}, wanted a known one")
        faults += [
            f"line {number}, {name}: found {row[name]!r}, wanted a number from 0"
            for name in TOLERANCES
            if not pd.to_numeric(row[name], errors="coerce") >= 0
        ]
    for row in recorded[recorded.duplicated(KEYS)].to_dict("records"):
        faults.append(f"{' / '.join(row[key] for key in KEYS)}: stands twice")
    return faults


def reason_of_renewal(why: str) -> str:
    """Why a record is renewed, in one line.

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


def line_of_renewal(
    reason: str, recorded: pd.DataFrame, measured: pd.DataFrame, *, of: str, code: str
) -> str:
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
    counts = f"{campaigns}: {changed} of {len(checked)} numbers new or changed"
    return f"* {of}: {reason} ({counts}{f'; code {code}' if code else ''})\n"


def renew(measured: pd.DataFrame, reason: str, path=RECORDED, *, code: str = ""):
    """Put measured numbers into the record (or `before`), and why at the end of the renewals."""
    recorded = read(path)
    line = line_of_renewal(reason, recorded, measured, of=path.stem, code=code)
    write(renewed(recorded, measured), path)
    written = RENEWALS.read_text(encoding="utf-8") if RENEWALS.is_file() else HEAD
    RENEWALS.write_text(written + line, encoding="utf-8")


def last_reason(of: str) -> str:
    """Why a table was last renewed, with what stands behind it in brackets; "" where never."""
    lines = RENEWALS.read_text(encoding="utf-8").splitlines() if RENEWALS.is_file() else []
    mine = [line.partition(": ")[2] for line in lines if line.startswith(f"* {of}: ")]
    return mine[-1] if mine else ""


def compare(recorded: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """Recorded beside measured numbers, with outcome: one row a number of the measured campaigns.

    Parameters
    ----------
    recorded, measured : tables of numbers as `tables.of_campaign` gives them.
    """
    recorded = recorded[recorded["campaign"].isin(measured["campaign"])]
    recorded = recorded.rename(columns={"value": "recorded"})
    new = measured[[*KEYS, "value", "unit", "better"]]
    new = new.rename(columns={"value": "found", "unit": "new_unit", "better": "new_better"})
    rows = recorded.merge(new, on=KEYS, how="outer", sort=False)
    for name in ("unit", "better"):
        rows[name] = rows[name].fillna(rows[f"new_{name}"])
    rows = rows.fillna("").drop(columns=["new_unit", "new_better"])
    rows["tolerance"] = [_tolerance(row) for row in rows.to_dict("records")]
    return rows.assign(outcome=[outcome(row) for row in rows.to_dict("records")])


def not_recorded(recorded: pd.DataFrame, measured: pd.DataFrame) -> list[str]:
    """One line for each measured campaign of which nothing is recorded."""
    names = [
        name for name in measured["campaign"].unique() if name not in set(recorded["campaign"])
    ]
    return [f"{name}: measured, and nothing is recorded of it; {REMEDY}" for name in names]


def _tolerance(row) -> float:
    """How much a number may change [its unit]; 0 for words."""
    if row["recorded"] == "" or row["better"] in ("equal", "shown"):
        return 0.0
    absolute, relative = float(row["tolerance_absolute"]), float(row["tolerance_relative"])
    return absolute + relative * abs(float(row["recorded"]))


def outcome(row: dict) -> str:
    """Whether one number is worse, missing, new, better or the same.

    Parameters
    ----------
    row : recorded, found and published (text, blank where there is none), better, tolerance.
    """
    if row["better"] == "shown" or row["recorded"] == row["found"]:
        return SAME
    if row["recorded"] == "":
        return NEW
    if row["found"] == "" and row["unit"] == "count":
        row = row | {"found": "0"}  # of what is not there any more there are none
    if row["found"] == "":
        return MISSING
    if row["better"] == "equal":
        return SAME if row["found"] == row["recorded"] else WORSE
    found, recorded = float(row["found"]), float(row["recorded"])
    if abs(found - recorded) <= row["tolerance"]:
        return SAME
    return BETTER if _is_better(row["better"], found, recorded, row["published"]) else WORSE


def _is_better(side, found, recorded, published) -> bool:
    if side == "near":
        known = published != ""
        return known and abs(found - float(published)) < abs(recorded - float(published))
    return found < recorded if side == "lower" else found > recorded


def differences(rows: pd.DataFrame) -> list[str]:
    """Lines for people: every number that is not as recorded, the worst kind first.

    Parameters
    ----------
    rows : as `compare` gives them.
    """
    lines = []
    for word in (WORSE, MISSING, BETTER, NEW):
        part = rows[rows["outcome"] == word]
        if len(part):
            lines.append(f"{HEADS[word]} ({len(part)}):")
        lines += [f"  {_line(row)}" for row in part.to_dict("records")]
    count = rows["outcome"].isin([SAME]).sum()
    return [*lines, f"{count} of {len(rows)} numbers as recorded, within their tolerances."]


def _line(row) -> str:
    what = ", ".join(row[key] for key in KEYS if row[key])
    unit = "" if row["unit"] in ("word", "1", "count") else f" {row['unit']}"
    values = f"recorded {row['recorded'] or 'nothing'}, found {row['found'] or 'nothing'}{unit}"
    return f"{what}: {values}, tolerance {row['tolerance']:.3g}"
