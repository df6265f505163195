"""Verdicts beside what was hidden: what each answer is worth, and the shares of many."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from effect_benchmark.scoring import Level, Share
from runtime import artefact
from virtual_lab.score import verdicts
from virtual_lab.score.comparison import NORMAL_95
from virtual_lab.zoo import parts
from virtual_lab.zoo.planted import UNPLANTED

SHEET = "sheet"  # kind of a cell whose sheet or sensor is wrong, and nothing of the cell
HEALTHY = verdicts.HEALTHY
CONTENT = ("right", "right, as one of a tie", "rightly silent")
ALARMS = ("false alarm", "false name", "called unknown")
NAMING = ("named", "ambiguous")
HIDDEN = "the records fitted cannot show it"
NAN = float("nan")


class Judged(NamedTuple):
    """The answer on one cell or group, and what it is worth.

    part : of the zoo. hidden, said : names, joined by " + ". form : by which equation the effect
    was made. strength_millivolt : what a refitted plain circuit leaves of it on the records that
    judge. unproven : whether no record that judges shows the effect. outcome : as of
    `verdicts.outcome`. extra : number of names beside the right ones. said_probabilities :
    (probability, whether that answer is right) of each answer weighed. sizes_inside : of each
    parameter told on both sides whether the truth lies in the 95 % interval. against : why a hidden
    effect is not named, see `against_names`.
    """

    part: str
    cell: str
    kind: str
    hidden: str
    form: str
    strength_millivolt: float
    visible: bool
    unproven: bool
    verdict: str
    said: str
    outcome: str
    extra: int
    gap_closed: float
    before_millivolt: float
    after_millivolt: float
    floor_millivolt: float
    rounds: int
    cpu_second: float
    said_probabilities: tuple
    sizes_inside: tuple
    sentence: str
    against: str = ""

    @property
    def content(self) -> bool:
        """Whether nothing is wrong with the answer, extra names aside."""
        return self.outcome in CONTENT


def truth_of(folder) -> dict[str, dict]:
    """What was hidden in each cell or group of a campaign; references left out.

    Parameters
    ----------
    folder : of the campaign, with truth/missing_effect.json.
    """
    text = (Path(folder) / "truth" / "missing_effect.json").read_text(encoding="utf-8")
    document = json.loads(text)
    rows = document if isinstance(document, list) else list(document.get("cells", {}).values())
    return {row["cell"]: row for row in rows if row["kind"] != "reference"}


def judged(part: str, truth: dict[str, dict], answers: list[dict]) -> list[Judged]:
    """Each hidden cell with the answer on it, in the order of the names.

    Of a planted copy the names count that its unplanted one (`control`) has not: what nobody
    planted is the real cell's own. What is named without planting counts as not visible.

    Parameters
    ----------
    part : name of the part of the zoo. truth : of `truth_of`. answers : rows of
    `searching.answers`; a cell without one has no verdict.
    """
    mine = {row["cell"]: row for row in answers}
    cells = [cell for cell in sorted(truth) if truth[cell]["kind"] != UNPLANTED]
    return [_judged(part, *_planted(truth[cell], mine.get(cell), mine)) for cell in cells]


def _planted(hidden, answer, answers):
    """Truth and answer of a copy without the names that its control has; of others as they are."""
    control = answers.get(hidden.get("control"))
    if not (control and control["document"] and answer and answer["document"]):
        return hidden, answer
    known = {one["effect"] for one in names_said(json.loads(control["document"]))}
    verdict = json.loads(answer["document"])
    for key in ("effects", "partial"):
        verdict[key] = [one for one in verdict.get(key, []) if one["effect"] not in known]
    if verdict["verdict"] in NAMING and not verdict["effects"]:
        verdict["verdict"] = "unknown"
    # Probabilities weigh the cell's own effects as well.
    answer = answer | {"document": json.dumps(verdict | {"probabilities": {}})}
    shown = hidden["visible"] and not any(accept & known for accept in _accepted(hidden))
    return hidden | {"visible": shown}, answer


def _judged(part, hidden, answer):
    verdict = json.loads(answer["document"]) if answer and answer["document"] else None
    said = names_said(verdict)
    volt = (verdict or {}).get("validation_rmse_volt", {})
    # Of all effects together; a verdict that does not say it is told by its last effect.
    last = (verdict or {}).get("gap_closed", said[-1].get("gap_closed") if said else None)
    return Judged(
        part=part,
        cell=hidden["cell"],
        kind=hidden["kind"],
        hidden=" + ".join(one["effect"] for one in hidden["effects"]) or hidden["kind"],
        form=" + ".join(one.get("form", "") for one in hidden["effects"]).strip(" +"),
        strength_millivolt=strength(hidden),
        visible=bool(hidden["visible"]),
        unproven=bool(hidden.get("unproven", False)),
        verdict=verdict["verdict"] if verdict else "",
        said=" + ".join(one["effect"] for one in said),
        outcome=outcome(hidden, verdict),
        extra=extra_names(hidden, said),
        gap_closed=NAN if last is None else float(last),
        before_millivolt=1e3 * volt.get("before", NAN),
        after_millivolt=1e3 * volt.get("after", NAN),
        floor_millivolt=1e3 * (verdict or {}).get("floor_volt", NAN),
        rounds=answer["rounds"] if answer else 0,
        cpu_second=answer["cpu_second"] if answer else NAN,
        said_probabilities=_weighed(hidden, verdict),
        sizes_inside=_sizes(hidden, said),
        sentence=_sentence(verdict, answer),
        against="" if outcome(hidden, verdict) in CONTENT else _against(hidden, verdict),
    )


def against_names(names, verdict: dict) -> str:
    """Why none of several names of one effect is said, in words.

    Parameters
    ----------
    names : accepted for the effect. verdict : document, its `against` and `not_testable`.
    """
    if set(names) <= set(verdict.get("not_testable", ())):
        return HIDDEN
    told = verdict.get("against", {})
    words = [told[name] for name in names if name in told]
    return words[0] if words else "no candidate: others promise to explain more"


def _against(hidden, verdict):
    """Why hidden effects are not named, those of two joined."""
    names = _accepted(hidden) if verdict else []
    said = {
        name
        for one in names_said(verdict)
        for name in (one["effect"], *one.get("alternatives", ()))
    }
    missed = [sorted(accept) for accept in names if accept and not accept & said]
    return "; ".join(dict.fromkeys(against_names(accept, verdict) for accept in missed))


def strength(hidden: dict) -> float:
    """Largest strength [mV] of the hidden effects on the records that judge; 0 without one."""
    names = [f"{records}_gap_millivolt" for records in ("validation", "visible", "target")]
    known = [
        [one[name] for name in names if one.get(name) is not None] for one in hidden["effects"]
    ]
    return float(max((gaps[0] for gaps in known if gaps), default=0.0))


def names_said(verdict: dict | None) -> list[dict]:
    """Effects that a verdict names; at the end those of `unproven`, which it could not prove."""
    document = verdict or {}
    unproven = document.get("unproven") or []
    more = [{"effect": one} if isinstance(one, str) else one for one in unproven]
    proven = document.get("effects", [])
    known = {one["effect"] for one in proven}
    return [*proven, *(one for one in more if one["effect"] not in known)]


def outcome(hidden: dict, verdict: dict | None) -> str:
    """Outcome of a verdict in words, as `verdicts.outcome`; faults of sheets and sensors, too.

    Parameters
    ----------
    hidden : row of the truth. A cell of kind "sheet" is rightly called `none`, or by a name of its
        `accept`; where it is marked `unproven`, a right name that is not proven is right.
    verdict : the document of a verdict; None where none was given.
    """
    if verdict is None:
        return "no verdict"
    said = names_said(verdict)
    if hidden["kind"] == SHEET:
        return _of_sheet(hidden, verdict["verdict"], said)
    accepts = _accepted(hidden)
    if hidden["kind"] == "unknown" and said and any(accepts):
        # What explains the same data is a right name of an effect outside the vocabulary, too.
        return "right" if verdicts._partners(accepts, said) else "false name"
    if hidden.get("unproven") and said:
        every = len(verdicts._partners(accepts, said)) == len(accepts)
        return "right" if every else "false name"
    return verdicts.outcome(hidden, verdict)


def _accepted(hidden):
    """Right names of each hidden effect; of one outside the vocabulary those that explain it."""
    outside = hidden["kind"] == "unknown"
    return [
        set(one.get("accept") or ([] if outside else [one["effect"]])) for one in hidden["effects"]
    ]


def _of_sheet(hidden, word, said):
    if word == "none" or (said and not _unaccepted(hidden, said)):
        return "right"
    return "false name" if said else "called unknown"


def _unaccepted(hidden, said):
    """Names that the truth does not hold, of a cell whose sheet or sensor is wrong."""
    accept = {name for one in hidden["effects"] for name in one.get("accept", [])}
    return [one for one in said if not accept & {one["effect"], *one.get("alternatives", [])}]


def extra_names(hidden: dict, said: list[dict]) -> int:
    """Names beside the right ones, where there is one; parts of a hidden form are none of them."""
    partners = verdicts._partners(_accepted(hidden), said)
    parts = {name for one in hidden["effects"] for name in one.get("parts", [])}
    beside = [one for k, one in enumerate(said) if k not in partners]
    return sum(one["effect"] not in parts for one in beside) if partners else 0


def _weighed(hidden, verdict):
    """(probability, whether it is right) of each answer that a verdict weighs."""
    weighed = (verdict or {}).get("probabilities") or {}
    return tuple(
        (float(share), outcome(hidden, _as_verdict(text)) in CONTENT)
        for text, share in sorted(weighed.items())
    )


def _as_verdict(text):
    """The verdict that an answer in words stands for: none, unknown, or names joined by " + "."""
    if text in ("none", "unknown"):
        return {"verdict": text, "effects": []}
    return {"verdict": "named", "effects": [{"effect": name} for name in text.split(" + ")]}


def _sizes(hidden, said):
    """Of each size that truth and verdict both tell: whether it is within 1.96 σ."""
    partners = verdicts._partners([{one["effect"]} for one in hidden["effects"]], said)
    pairs = [(hidden["effects"][mine], said[number]) for number, mine in partners.items()]
    # Of a tie the sizes are those of its first name.
    same = [(truth, one) for truth, one in pairs if truth["effect"] == one["effect"]]
    both = [each for truth, one in same for each in _told_of(truth, one)]
    return tuple(
        bool(abs(told["value"] - true) <= NORMAL_95 * told["std"])
        for true, told in both
        if told.get("std") is not None
    )


def _told_of(truth, one):
    """(true, told) of each size of an effect: as people use them where the truth tells these.

    Else of each parameter, which mean the same where truth and model share a formula.
    """
    if "sizes" in truth:
        pairs = zip(truth["sizes"], one.get("sizes", ()), strict=False)
        return [(true, told) for true, told in pairs if true is not None]
    own = truth.get("parameters", {}).items()
    told = one.get("parameters", {})
    return [(v, told[name]) for name, v in own if name in told and isinstance(v, int | float)]


def _sentence(verdict, answer):
    if verdict is None:
        return answer["reason"] if answer else "not searched"
    return verdict.get("sentence") or verdict.get("paragraph", "")


# Goals of the parts: share of visible effects named right, by part; others hold for all parts.
RIGHT_GOAL = {"fast": 0.92, "forms": 0.8, "physics": 0.8, "planted": 0.8}


def shares(rows: list[Judged], part: str = "") -> list:
    """What counts of one part of the zoo, with its goals: Share and Level.

    Parameters
    ----------
    rows : of the part. part : its name, for the goal of the visible effects.
    """
    answered = [row for row in rows if row.verdict]
    hidden = [row for row in rows if row.kind in ("single", "two")]
    visible = [row for row in hidden if row.visible]
    told = [row for row in hidden if row.verdict]
    named = [row for row in told if row.outcome in verdicts.NAMED]
    outside = [row for row in answered if row.kind == "unknown"]
    return [
        _share("visible effects right", visible, is_right, "at least", RIGHT_GOAL.get(part, NAN)),
        _share("false names", told, _is("false name"), "at most", 0.02),
        _share("extra names", told, lambda row: row.extra > 0, "at most", 0.03),
        _share("healthy anything but none", _kind(answered, *HEALTHY), _alarm, "at most", 0.02),
        _share(
            "sheet or sensor wrong: anything else", _kind(answered, SHEET), _alarm, "at most", 0.02
        ),
        _share("outside the vocabulary, given a name", outside, _is("false name"), "at most", 0.05),
        *_gaps(named),
        *_told(answered),
        _level("CPU a cell and round, median", _cpu(answered), 50, "at most", 0.5, "s"),
    ]


def _share(name, rows, hit, side, wanted):
    side = side if wanted == wanted else ""
    return Share(name, sum(map(bool, map(hit, rows))), len(rows), side, wanted)


def _level(name, values, percentile, side, wanted, unit):
    value = float(np.percentile(values, percentile)) if len(values) else NAN
    return Level(name, value, len(values), side, wanted, unit)


def _is(*outcomes):
    return lambda row: row.outcome in outcomes


def is_right(row: Judged) -> bool:
    """Whether a hidden effect was named right, ties included."""
    return row.outcome in verdicts.NAMED


def _alarm(row):
    return row.outcome in ALARMS


def _kind(rows, *kinds):
    return [row for row in rows if row.kind in kinds]


def _cpu(rows):
    each = np.array([row.cpu_second / max(row.rounds, 1) for row in rows])
    return each[np.isfinite(each)]


def _gaps(named):
    closed = np.array([row.gap_closed for row in named])
    closed = closed[np.isfinite(closed)]
    return [
        _level("gap closed, median", closed, 50, "at least", 0.95, "share"),
        _level("gap closed, lowest tenth", closed, 10, "at least", 0.8, "share"),
    ]


def _told(rows):
    """How the stated intervals and probabilities hold."""
    inside = [one for row in rows for one in row.sizes_inside]
    best = [max(row.said_probabilities) for row in rows if row.said_probabilities]
    off = abs(np.mean([p for p, _ in best]) - np.mean([hit for _, hit in best])) if best else NAN
    return [
        Share("sizes within their 95 % interval", sum(inside), len(inside), "at least", 0.9),
        Level("best answer: said minus right", float(off), len(best), "at most", 0.05, "share"),
    ]


BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)


def calibration(rows: list[Judged]) -> list[dict]:
    """Said probabilities in bins: how many, their mean, and the share that was right."""
    pairs = np.array([pair for row in rows for pair in row.said_probabilities], float)
    if not len(pairs):
        return []
    place = np.clip(np.searchsorted(BINS, pairs[:, 0], side="right") - 1, 0, len(BINS) - 2)
    return [
        {
            "said": float(pairs[place == k, 0].mean()),
            "right": Share("right", int(pairs[place == k, 1].sum()), int((place == k).sum())),
        }
        for k in np.unique(place)
    ]


def wrong(rows: list[Judged]) -> list[Judged]:
    """Answers that are wrong, or right with names too many; by outcome and what was hidden."""
    bad = [row for row in rows if not row.content or row.extra]
    return sorted(bad, key=lambda row: (row.outcome, row.hidden, row.cell))


def of_part(part: str, folder, answers: list[dict]) -> list[Judged]:
    """All cells of a part of the zoo with their answers.

    Parameters
    ----------
    part : its name. folder : of the part, with its campaigns. answers : rows of
    `searching.part_batch`.
    """
    rows = []
    for path in parts.campaigns_of(folder):
        campaign = "" if path == Path(folder) else path.name
        own = [row for row in answers if row["campaign"] == campaign]
        judged_here = judged(part, truth_of(path), own)
        prefix = f"{campaign}/" if campaign else ""
        rows += [row._replace(cell=prefix + row.cell) for row in judged_here]
    return rows


COLUMNS = (
    *("part", "cell", "kind", "hidden", "form", "strength_millivolt", "visible", "unproven"),
    *("verdict", "said", "outcome", "extra", "gap_closed", "before_millivolt", "after_millivolt"),
    *("floor_millivolt", "rounds", "cpu_second", "sentence", "against"),
)


def columns(rows: list[Judged]) -> dict:
    """Judged cells as columns by name, (n,) each."""
    return {name: np.array([getattr(row, name) for row in rows]) for name in COLUMNS}


def of_parts(folder, batches: list[tuple]) -> tuple[list[Judged], dict[str, str]]:
    """Judged cells of all parts, and why a part was not made, by its name.

    Parameters
    ----------
    folder : with a folder for each part. batches : (columns of answers, about) each, as stored.
    """
    answers = {}
    for table, about in batches:
        answers.setdefault(about["wildcards"]["part"], []).extend(artefact.rows(table))
    rows, skipped = [], {}
    for made in sorted(Path(folder).glob("*/made.json")):
        part, why = made.parent.name, json.loads(made.read_text(encoding="utf-8"))["skipped"]
        skipped |= {part: why} if why else {}
        rows += [] if why else of_part(part, made.parent, answers.get(part, []))
    return rows, skipped
