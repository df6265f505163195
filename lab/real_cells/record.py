"""Tables of numbers of real cells: gathered, recorded, renewed, compared with the record."""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from real_cells.campaigns import ROOT
from real_cells.measured import COLUMNS, KEYS, MEASUREMENTS, MODEL, PERCENT, QUANTITIES, SEARCH
from virtual_lab.score import files, summary

FOLDER = ROOT / "docs" / "real-cells"
RECORDED, BEFORE = FOLDER / "recorded.csv", FOLDER / "before.csv"
PUBLISHED, RENEWALS = FOLDER / "published.csv", FOLDER / "renewals.md"
HEAD = """\
# Renewals of the record of real cells

Why the numbers of [recorded.csv](recorded.csv) and [before.csv](before.csv) were last renewed, the
newest last; earlier reasons stand in the history of this file. Made by
lab/tools/real_record.py. `code` is the hash of all code of the pipeline,
where the numbers are from a run of its own.

"""
RENEWALS_KEPT = 4  # of each table: those that explain the numbers that stand there now
TOLERANCES = ["tolerance_absolute", "tolerance_relative"]
WORSE, MISSING, NEW, BETTER, SAME = "worse", "missing", "new", "better", "same"
FAILING = (WORSE, MISSING)
REMEDY = "./run python lab/tools/real_record.py --why '...' records them"
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
    """The record, with the rows of the measured campaigns replaced.

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
    """Faults of a record, such as an edited tolerance that is not a number."""
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
    note_renewal(line, of=path.stem)


def note_renewal(line: str, *, of: str):
    """Put a line at the end of the renewals; of each table the last few stay."""
    lines = [*_renewals(), line]
    of_table = [other for other in lines if other.startswith(f"* {of}: ")]
    lines = [other for other in lines if other not in of_table[:-RENEWALS_KEPT]]
    RENEWALS.write_text(HEAD + "".join(lines), encoding="utf-8")


def _renewals() -> list[str]:
    """Lines of the list of renewals, the oldest first."""
    text = RENEWALS.read_text(encoding="utf-8") if RENEWALS.is_file() else ""
    return [line for line in text.splitlines(keepends=True) if line.startswith("* ")]


def last_reason(of: str) -> str:
    """Why a table was last renewed, with what stands behind it in brackets; "" where never."""
    reasons = [line.partition(": ")[2] for line in _renewals() if line.startswith(f"* {of}: ")]
    return reasons[-1].strip() if reasons else ""


def compare(recorded: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """Recorded beside measured numbers, with outcome: one row a number of the measured campaigns.

    Parameters
    ----------
    recorded, measured : tables of numbers as `record.of_campaign` gives them.
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
    value, recorded = float(row["found"]), float(row["recorded"])
    if abs(value - recorded) <= row["tolerance"]:
        return SAME
    return BETTER if _is_better(row["better"], value, recorded, row["published"]) else WORSE


def _is_better(side, value, recorded, published) -> bool:
    if side == "near":
        published_known = published != ""
        return published_known and abs(value - float(published)) < abs(recorded - float(published))
    return value < recorded if side == "lower" else value > recorded


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
    label = ", ".join(row[key] for key in KEYS if row[key])
    unit = "" if row["unit"] in ("word", "1", "count") else f" {row['unit']}"
    values = f"recorded {row['recorded'] or 'nothing'}, found {row['found'] or 'nothing'}{unit}"
    return f"{label}: {values}, tolerance {row['tolerance']:.3g}"


LAST_RUN = ROOT / "real" / "numbers.csv"
MOST_CELLS = 8  # of a campaign with more, models and verdicts are put together over all cells


def of_campaign(campaign, *, name: str | None = None) -> pd.DataFrame:
    """Every measured number of one finished campaign, values as text with six digits.

    Parameters
    ----------
    campaign : folder with `results/` and `config/`.
    name : of the campaign (default: the folder's).
    """
    measured = [row for measure in MEASUREMENTS for row in measure(campaign)]
    rows = pd.DataFrame(measured, columns=["cell", "quantity", "where", "value"])
    rows = described(over_cells(rows), name or Path(campaign).name)
    if "right verdicts" in set(rows["quantity"]):  # then right is what counts, not the words
        rows.loc[rows["quantity"].isin(["verdict", "named effects"]), "better"] = "shown"
    return rows


def finished_campaigns(folder) -> list[Path]:
    """The finished campaigns in a folder: those whose results were held against physics."""
    return [path.parents[2] for path in sorted(Path(folder).glob("*/results/tables/checks.csv"))]


def described(rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Rows (cell, quantity, where, value) with unit, side and tolerance; NaN values removed.

    A column `unit` goes before the unit of the quantity. `name` is the campaign's.
    """
    rows = rows[rows["value"].map(lambda value: isinstance(value, str) or np.isfinite(value))]
    rows = rows.assign(campaign=name, value=rows["value"].map(_six_digits))
    return _with_tolerances(rows.assign(published="", published_source=""))


def _with_tolerances(rows):
    """The rows with unit, side and tolerance of their quantity; a unit of their own stays."""
    quantities = [QUANTITIES[quantity] for quantity in rows["quantity"]]
    return rows.assign(
        unit=rows["unit"] if "unit" in rows else [quantity.unit for quantity in quantities],
        better=[quantity.better for quantity in quantities],
        tolerance_absolute=[_six_digits(quantity.absolute) for quantity in quantities],
        tolerance_relative=[_six_digits(quantity.relative) for quantity in quantities],
    )[COLUMNS]


def _six_digits(value) -> str:
    """A number with six digits, a word as it is."""
    return value if isinstance(value, str) else f"{float(value):.6g}"


def with_published(rows: pd.DataFrame, published: pd.DataFrame) -> pd.DataFrame:
    """The same numbers, each beside the published one of its campaign, cell, quantity and place.

    A published number of these campaigns that the results do not have stands with a blank value.
    """
    of_campaigns = published[published["campaign"].isin(rows["campaign"])]
    of_campaigns = of_campaigns.rename(columns={"value": "published", "source": "published_source"})
    both = rows.drop(columns=["published", "published_source"]).merge(
        of_campaigns, on=KEYS, how="left"
    )
    measured = pd.MultiIndex.from_frame(rows[KEYS])
    alone = of_campaigns[~pd.MultiIndex.from_frame(of_campaigns[KEYS]).isin(measured)]
    blank = _with_tolerances(alone.assign(value=""))
    return pd.concat([both, blank], ignore_index=True).fillna("")[COLUMNS]


def over_cells(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows; of many cells, models and verdicts as median and worst over the cells."""
    if rows["cell"].nunique() <= MOST_CELLS:
        return rows
    quantities = rows["quantity"].map(QUANTITIES)
    many = pd.Series([quantity.topic in (MODEL, SEARCH) for quantity in quantities], rows.index)
    many &= rows["cell"] != "all"
    together = pd.DataFrame(list(_median_and_worst(rows[many])), columns=rows.columns)
    return pd.concat([rows[~many], together], ignore_index=True)


def _median_and_worst(rows):
    """Median and worst of each number over the cells; how many cells have which word."""
    for (quantity, where), same in rows.groupby(["quantity", "where"], sort=False):
        known_quantity = QUANTITIES[quantity]
        if known_quantity.unit == "word":
            counts = same["value"].value_counts().sort_index()
            words = "; ".join(f"{word}: {count}" for word, count in counts.items())
            yield "all", quantity, where, words
            continue
        values = same["value"].astype(float)
        cells = f"{len(values)} cells"
        worst = values.min() if known_quantity.better == "higher" else values.max()
        yield f"median of {cells}", quantity, where, values.median()
        yield f"worst of {cells}", quantity, where, worst


def of_demo(repository) -> pd.DataFrame:
    """Every number of the finished demo campaign: as for real cells, and its errors against truth.

    Parameters
    ----------
    repository : folder with `results/`, `config/` and `tests/truth/`.
    """
    folders = (Path(repository, part) for part in ("results", "tests/truth", "config"))
    scored = pd.DataFrame(
        list(errors_against_truth(summary.score(files.Campaign(*folders)).summary)),
        columns=["cell", "quantity", "where", "value", "unit"],
    )
    measured = of_campaign(repository, name="demo")
    # The records of jobs in the repository are those of other targets too.
    measured = measured[measured["quantity"] != "time of all jobs"]
    return pd.concat([measured, described(scored, "demo")], ignore_index=True)


def errors_against_truth(scores: pd.DataFrame):
    """One row a scored quantity: root mean square error, share, rows that are missing."""
    for row in scores[scores["state"] == "scored"].to_dict("records"):
        where = ", ".join(name for name in (row["table"], row["quantity"]) if name)
        if pd.notna(row["rms_error"]):
            unit = "" if row["unit"] == "1" else row["unit"]
            yield "all", "error against the truth", where, row["rms_error"], unit
        if pd.notna(row["share"]):
            yield "all", "share that is right", where, PERCENT * row["share"], "%"
        if pd.notna(row["n_missing"]):
            quantity = "rows that the truth has and the results have not"
            yield "all", quantity, where, row["n_missing"], "count"


def command_line(about: str) -> argparse.ArgumentParser:
    """The options of a tool that say where its numbers come from; `about` is its description."""
    parser = argparse.ArgumentParser(description=about)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--from", dest="folder", help="gather from a folder of finished campaigns")
    source.add_argument(
        "--demo", action="store_true", help="the finished demo campaign, against its truth"
    )
    return parser


def of_command_line(options) -> pd.DataFrame:
    """Numbers that the options ask for: of the last `real` run, a folder, or the demo campaign.

    Raises
    ------
    FileNotFoundError
        Where there are none.
    """
    if options.demo:
        return of_demo(ROOT)
    if options.folder:
        tables = [of_campaign(campaign) for campaign in finished_campaigns(options.folder)]
        if not tables:
            raise FileNotFoundError(
                f"{options.folder}: found no finished campaign (results/tables/checks.csv)"
            )
        rows = pd.concat(tables, ignore_index=True)
        return with_published(rows, read(PUBLISHED))
    if not LAST_RUN.is_file():
        raise FileNotFoundError(
            "real/numbers.csv: found none; first run "
            "`./run snakemake -s lab/Snakefile --cores 2 real`"
        )
    return read(LAST_RUN)
