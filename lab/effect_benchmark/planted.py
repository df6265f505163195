"""Effects planted in records of real cells: answers beside what was planted.

What the search names in the unplanted copy of a cell it names without any planting; judged is which
names are new in the planted copy. Of the base `own`, the model that the pipeline chose for the
planted copy may have taken the effect up: by a branch that the unplanted copy's has not, or by its
parameters. Both are counted by themselves, and neither is a right name.
"""

import json

import numpy as np
import pandas as pd

from effect_benchmark.scoring import Share, share
from effect_benchmark.zoo import judging, searching
from virtual_lab.score import files
from virtual_lab.zoo.planted import UNPLANTED

RIGHT, TIED = "right", "right, as one of a tie"
WRONG, SILENT = "wrong new name", "no new name"
KNOWN, NOTHING = "named without planting", "no verdict"
TOLD, HELD = "told by the model's branches", "followed by the model"
DECLARED = "no name, told as declared wrongly"
OUTCOMES = (RIGHT, TIED, DECLARED, TOLD, HELD, WRONG, SILENT, KNOWN, NOTHING)
FOLDERS = {"plain": "", "own": "own", "external": "external"}  # of a base, beside its cell's
# Letters of a member's name, and the effects that such a branch is there for.
BRANCHES = {
    "H": {"hysteresis_one_state", "hysteresis_instant"},
    "K": {"charge_transfer_nonlinearity"},
    "D": {"slow_diffusion"},
}
# What the capacity is off by, of a planted size.
IN_CAPACITY = {
    "capacity_error": ("relative", lambda relative: 1.0 / (1.0 + relative) - 1.0),
    "current_gain": ("gain_relative", lambda gain: gain),
}
SIDES = ("rmse_volt", "validation_rmse_volt")
HALF = 0.5  # of what was planted: where the model's error rises by less, it has followed the effect
# By what is left of the effect, over what a plain circuit leaves of the unplanted records; sizes
# are met within a few percent.
BANDS = {"1 and more": (0.9, np.inf), "0.5 to 1": (0.45, 0.9), "below 0.5": (0.0, 0.45)}
GOALS = {"1 and more": 0.8, "0.5 to 1": 0.6}


def answers_of(folder, sizes=None, done=()):
    """Rows of `searching.answers`, one cell at a time: unplanted copies, then the planted ones.

    Parameters
    ----------
    folder : of the campaign; its own settings are used, of its truth only the names and sizes.
    sizes : those of the copies that are searched, as "1base"; None: all. done : cells to skip.
    """
    work = searching.Folder(folder)
    for row in _chosen(folder, sizes):
        if row["cell"] not in done:
            yield from searching.answers(work, [row["cell"]])


def answers_of_run(folder, base: str) -> list[dict]:
    """Rows as of `answers_of`, from a run of the pipeline in the campaign's folder.

    Parameters
    ----------
    folder : of the campaign, with `results`. base : "plain", "own" or "external".
    """
    place = files.campaign(folder).results / "missing_effect"
    rows = []
    for row in _chosen(folder, None):
        found = place / row["cell"] / FOLDERS[base] / "verdict.json"
        text = found.read_text(encoding="utf-8") if found.is_file() else ""
        document = json.loads(text) if text else {}
        given = "verdict" in document
        reason = "" if given else document.get("reason") or f"no {found.name} of base {base}"
        document = text if given else ""
        rows.append({"cell": row["cell"], "document": document, "reason": reason})
    return rows


def members_of_run(folder) -> dict[str, str]:
    """Member that the pipeline chose for each copy before the search of base `own`, by cell."""
    place = files.campaign(folder).results / "member"
    return {file.stem: files.read_json(file).get("chosen") or "" for file in place.glob("*.json")}


def _chosen(folder, sizes):
    rows = files.read_json(files.campaign(folder).truth / "missing_effect.json")
    controls = [row for row in rows if row["kind"] == UNPLANTED]
    asked = [row for row in rows if "size" in row and (sizes is None or row["size"] in sizes)]
    return [*controls, *asked]


def judged(folder, answers: list[dict], sizes=None, members=None) -> pd.DataFrame:
    """One row a planted copy: what was planted, which names are new, and the outcome.

    `outcome`: "right" where a new name is accepted (with its alternatives, then "as one of a tie"),
    "wrong new name", "no new name", "named without planting" where an accepted name stands in the
    answer on the unplanted copy, too, "no name, told as declared wrongly" where beside no new name
    half and more of an error of capacity or current is told as one of the sheet's capacity (no
    right name), or "no verdict" where either copy has none. `wrong_names`: how many new names are
    not accepted, whatever the outcome. `size_ratio`: what the right new name closes of the error on
    the records that judge, over what was planted. `nearest_right`: an accepted name is new among
    the explanations that an answer "unknown" tried and did not name.
    `rise_millivolt`: by how much the first model of the search errs more than on the unplanted
    copy, the larger of fit and proof (root of the difference of squares): what stated tolerances
    take up, or what meets an error of the opposite sign, is not in it. `against`: why the effect is
    no name.

    Parameters
    ----------
    folder : of the campaign with its truth. answers : rows of `answers_of`. sizes : of the copies
    that are judged, as "1base"; None: all. members : of `members_of_run`, of answers of base `own`:
        where no new name is right, "told by the model's branches" says that the copy's member has
        a branch for the effect which the unplanted copy's has not, "followed by the model" that
        the member's error on the records that judge rises by less than half of what was planted.
    """
    said = {row["cell"]: row for row in answers}
    rows = [row for row in _chosen(folder, sizes) if row["kind"] != UNPLANTED]
    table = pd.DataFrame(
        [_row(row, said.get(row["cell"]), said.get(row["control"])) for row in rows]
    )
    return table if members is None else _with_members(table, rows, said, members)


def _with_members(table, truth, said, members):
    """The table with the members of the copies, and with what these have taken up."""
    table = table.assign(
        member=[members.get(row["cell"], "") for row in truth],
        control_member=[members.get(row["control"], "") for row in truth],
    )
    silent = table["outcome"].isin([SILENT, WRONG])
    for place in table.index[silent]:
        row = truth[place]
        new = _branches(table.at[place, "member"]) - _branches(table.at[place, "control_member"])
        accept = set(row["effects"][0]["accept"])
        if any(BRANCHES[one] & accept for one in new):
            table.loc[place, "outcome"] = TOLD
        elif _followed(row, said):
            table.loc[place, "outcome"] = HELD
    return table


def _branches(member):
    """Letters of a member's branches: of DRT+H+K those of hysteresis and kinetics."""
    return set(member.split("+")[1:]) & set(BRANCHES)


def _followed(row, said):
    """Whether a given model's error rises by less than half of what was planted."""
    verdicts = (_verdict(said.get(row[copy])) for copy in ("cell", "control"))
    errors = [(one or {}).get("as_given_rmse_volt", {}).get("validation") for one in verdicts]
    if None in errors:
        return False
    rise = np.sqrt(max(errors[0] ** 2 - errors[1] ** 2, 0.0))
    return rise < HALF * 1e-3 * row["effects"][0]["visible_gap_millivolt"]


def _verdict(answer):
    return json.loads(answer["document"]) if answer and answer["document"] else None


def _row(truth, answer, control_answer):
    verdict, control = _verdict(answer), _verdict(control_answer)
    reasons = [one["reason"] for one in (answer, control_answer) if one and one["reason"]]
    (effect,) = truth["effects"]
    row = {
        "cell": truth["cell"],
        "campaign": truth["campaign"],
        "planted": effect["effect"],
        "millivolt": effect["visible_gap_millivolt"],
        "base_millivolt": 1e3 * truth["base_volt"],
        "relative_size": truth["relative_size"],
        "visible": truth["visible"],
        "verdict": verdict["verdict"] if verdict else None,
        "new": "",
        "outcome": NOTHING,
        "wrong_names": np.nan,
        "nearest_right": False,
        "size_ratio": np.nan,
        "reason": "; ".join(reasons),
        "control": "",
        "rise_millivolt": np.nan,
        "against": "",
    }
    if verdict is None or control is None:
        return row
    before = {one["effect"] for one in control["effects"]}
    accept = set(effect["accept"])
    new = [one for one in verdict["effects"] if one["effect"] not in before]
    right = [one for one in new if _names(one) & accept]
    row |= {"new": " + ".join(one["effect"] for one in new), "control": " + ".join(sorted(before))}
    row |= {"wrong_names": len(new) - len(right), "outcome": _outcome(before & accept, new, right)}
    if row["outcome"] == SILENT and _declared_wrongly(effect, verdict, control):
        row["outcome"] = DECLARED
    tried = [one["effect"] for one in control.get("partial", [])]
    nearest = [one for one in verdict.get("partial", []) if one["effect"] not in {*before, *tried}]
    row["nearest_right"] = any(_names(one) & accept for one in nearest)
    row["rise_millivolt"] = 1e3 * max(_rise_volt(verdict, control, side) for side in SIDES)
    if not right:
        row["against"] = judging.against_names(sorted(accept), verdict)
    if right:
        row["size_ratio"] = _closed_volt(right[0]) / (1e-3 * effect["visible_gap_millivolt"])
    return row


def _rise_volt(verdict, control, side):
    """Root of what an effect adds to the mean square error of the search's first model [V]."""
    now, was = (one.get(side, {}).get("before", np.nan) for one in (verdict, control))
    return float(np.sqrt(max(now**2 - was**2, 0.0)))


def _names(one):
    return {one["effect"], *one.get("alternatives", [])}


def _outcome(known, new, right):
    if known:
        return KNOWN
    if right:
        return TIED if len(_names(right[0])) > 1 else RIGHT
    return WRONG if new else SILENT


def _declared_wrongly(effect, verdict, control):
    """Whether half of an error that capacity takes up is told as one of the sheet's.

    A slow test whose current read 10 % too little has told a capacity that is 10 % too small; one
    beside a current that reads 10 % too little in all other tests is 10 % too large for them.
    """
    if effect["effect"] not in IN_CAPACITY:
        return False
    told, known = (
        sum(one["value"] for one in document.get("nuisances", ()) if one["name"] == "capacity")
        for document in (verdict, control)
    )
    name, capacity = IN_CAPACITY[effect["effect"]]
    return (told - known) / capacity(effect["parameters"][name]) >= HALF


def _closed_volt(one):
    """Root of the mean square that a name takes away on records that judge [V]; 0 where it adds."""
    volt = one["validation_rmse_volt"]
    return float(np.sqrt(max(volt["before"] ** 2 - volt["after"] ** 2, 0.0)))


def right(table: pd.DataFrame) -> pd.Series:
    """Rows whose new name is right, ties included."""
    return table["outcome"].isin([RIGHT, TIED])


def in_band(table: pd.DataFrame, band: str) -> pd.DataFrame:
    """Rows of a band of `BANDS`."""
    low, high = BANDS[band]
    return table[(table["relative_size"] >= low) & (table["relative_size"] < high)]


def shares(table: pd.DataFrame) -> list[dict]:
    """By campaign (and all together) and band of size: right, wrong new names, size.

    Copies whose effect the search names without planting are counted, and left out of the shares.
    """
    rows = []
    for campaign in ["all", *dict.fromkeys(table["campaign"])]:
        part = table if campaign == "all" else table[table["campaign"] == campaign]
        rows += [{"campaign": campaign, "band": b} | _shares(in_band(part, b), b) for b in BANDS]
    return [row for row in rows if row["copies"]]


def _shares(part, band):
    asked = part[part["outcome"] != KNOWN]
    goal = ("at least", GOALS[band]) if band in GOALS else ()
    sizes = part.loc[right(part), "size_ratio"].dropna().to_numpy(float)
    return {
        "copies": len(part),
        "known": int((part["outcome"] == KNOWN).sum()),
        "right": share("right", asked, right, *goal),
        "wrong": share("wrong new name", part, lambda t: t["wrong_names"] > 0, "at most", 0.02),
        "size_ratio": float(np.median(sizes)) if sizes.size else float("nan"),
    }


def by_effect(table: pd.DataFrame) -> pd.DataFrame:
    """Numbers of copies of half of the base error and more: effect planted against the outcome."""
    seen = table[table["relative_size"] >= BANDS["0.5 to 1"][0]]
    counts = pd.crosstab(seen["planted"], seen["outcome"])
    return counts.reindex(columns=[one for one in OUTCOMES if one in counts])


WITHIN = "within the stated tolerances, or against the model's own error"


def reasons(table: pd.DataFrame) -> list[tuple[str, str, int]]:
    """Why copies of half of the base error and more have no right name: (band, reason, copies).

    What raises the error of the search's own first model by less than half of what was planted is
    counted as taken up, whatever rule spoke last; of several reasons the first is told.
    """
    missed = table[~right(table) & ~table["outcome"].isin([KNOWN, NOTHING])]
    rows = []
    for band in GOALS:
        mine = in_band(missed, band)
        shown = mine["rise_millivolt"] >= HALF * mine["millivolt"]
        first = mine["against"].str.split("; ").str[0]
        why = first.where(shown | (mine["against"] == judging.HIDDEN), WITHIN)
        rows += [(band, words, int(n)) for words, n in why.value_counts().items()]
    return rows


def page(table: pd.DataFrame) -> str:
    """The scores as Markdown."""
    lines = [
        "| campaign | size over base error | copies | named without planting | right |"
        " a wrong new name | size found over planted |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in shares(table):
        size = "–" if np.isnan(row["size_ratio"]) else f"{row['size_ratio']:.2f}"
        cells = [row["campaign"], row["band"], row["copies"], row["known"]]
        cells += [_told(row["right"]), _told(row["wrong"]), size]
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    counts = by_effect(table)
    lines += ["", "| planted, half of the base error and more | " + " | ".join(counts) + " |"]
    lines.append("| --- " * (1 + counts.shape[1]) + "|")
    for name, numbers in counts.iterrows():
        lines.append(f"| `{name}` | " + " | ".join(str(x) for x in numbers) + " |")
    lines += ["", "| size over base error | why there is no right name | copies |"]
    lines += ["| --- | --- | --- |"]
    lines += [f"| {band} | {words} | {copies} |" for band, words, copies in reasons(table)]
    return "\n".join(lines) + "\n"


def _told(one: Share) -> str:
    low, high = one.interval
    return f"{one.hits} of {one.of} ({low:.0%}–{high:.0%})" if one.of else "–"
