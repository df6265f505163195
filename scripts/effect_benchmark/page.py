"""The benchmark's page, in Markdown: goals beside what was measured, and every table."""

from pathlib import Path

from effect_benchmark import scoring, tables

WORDS = {
    "search": "the search",
    "bic_alone": "criterion on the fitted records (BIC) alone",
    "validation_rmse_alone": "error on validation data alone",
    "random_term": "a random smooth term of as many parameters",
    "permuted_current": "the same effect from a current in another order",
    "extra_rc": "an extra RC pair, always added",
}
LOGGED = {
    "search": "branch currents, drives at three temperatures",
    "one_temperature": "branch currents, drives near 25 °C only",
    "no_branch_currents": "the group's voltage and current only",
}
MARK = {True: "yes", False: "**no**", None: "–"}
INTRODUCTION = """# The benchmark of the missing effect

Made by `snakemake missing_effect_benchmark`, put here by `scripts/tools/publish_benchmark.py`;
nothing on this page is written by hand. The rule `effect_campaign` has the
[virtual laboratory](virtual-laboratory.md) make a campaign with hidden effects ({options}), by
equations that share no code with the models fitted here. `effect_left_out` tells the searches which
names to do without in the class-left-out test, and nothing else of the truth; `effect_answers`
searches, a batch of cells a job, and tries the controls; `missing_effect_benchmark` sets what was
answered beside the truth. Gates and tolerances are those of the [config](../config/README.md).
{cells} cells and groups were to be answered, {silent} were not. Shares are given with 95 % Wilson
intervals. An effect is visible where a refitted plain circuit leaves more than 1.15 (fit) or 1.3
(validation) times the noise.
"""


def markdown(table, options: str) -> str:
    """The page.

    Parameters
    ----------
    table : of `scoring.judged`. options : the campaign's sizes and seed, in words.
    """
    mine = table[table["method"] == "search"]
    silent = int(mine["verdict"].isna().sum())
    parts = [
        INTRODUCTION.format(options=options, cells=len(mine), silent=silent),
        "## Goals\n\n" + _goals(scoring.goals(table)),
        "## Power\n\n![Power against strength](effect-power.svg)\n\n" + _power(tables.power(table)),
        "## Confusion\n\n![Hidden against answered](effect-confusion.svg)\n",
        "## The true class left out of the library\n\n"
        "The right answer is unknown; at 1 mV, silence often is, too.\n\n"
        + _shares(tables.left_out(table)),
        "## Other ways of ranking, on the same cells\n\n" + _rankings(tables.rankings(table)),
        "## Terms that must not help\n\n"
        "Each refitted beside the plain model, with the noise of the search's first round, and\n"
        "held against the same gates. Charge that passed is the same in any order: of effects\n"
        "that follow it (leakage, efficiency, capacity), much survives another order.\n\n"
        + _controls(tables.controls(table)),
        "## Parallel groups\n\n"
        "Each group is held against models of its cells by themselves. The strength is what a\n"
        "branch current has of its own, times that cell's resistance. Without branch currents\n"
        "a verdict is at best ambiguous, and its first name a guess.\n\n"
        + _groups(tables.groups(table)),
        "## Where it is wrong\n\n" + _misses(tables.misses(table)),
    ]
    return "\n".join(parts)


def save(table, options: str, job, path):
    """Write the page as one of a job's outputs, with what it was made by at its foot."""
    about = job.about()
    foot = f"\nCode `{about['code']}`, environment `{about['environment_lock'][:16]}`.\n"
    Path(path).write_text(markdown(table, options) + foot, encoding="utf-8")
    job.saved.add(path)


def percent(share: scoring.Share) -> str:
    """`93.1 % (88.0–96.1), 149 of 160`."""
    if not share.of:
        return "not measured"
    low, high = share.interval
    interval = f"({100 * low:.1f}–{100 * high:.1f})"
    return f"{100 * share.share:.1f} % {interval}, {share.hits} of {share.of}"


def lines(header, rows) -> str:
    """A table in Markdown."""
    shown = [header, ["---"] * len(header), *rows]
    return "".join("| " + " | ".join(map(str, row)) + " |\n" for row in shown)


def _goals(goals):
    rows = [[one.name, _wanted(one), _measured(one), MARK[one.reached]] for one in goals]
    return lines(["what", "goal", "measured", "reached"], rows)


def _wanted(one):
    if not one.side:
        return "–"
    sign = {"at least": "≥", "at most": "≤"}[one.side]
    return f"{sign} {one.wanted:g} s" if _seconds(one) else f"{sign} {100 * one.wanted:g} %"


def _measured(one):
    if isinstance(one, scoring.Share):
        return percent(one)
    if not one.of:
        return "not measured"
    value = f"{one.value:.2f} s" if _seconds(one) else f"{100 * one.value:.1f} %"
    return f"{value}, of {one.of}"


def _seconds(one):
    return getattr(one, "unit", "") == "s"


def _power(rows):
    header = [
        "effect",
        "dynamic",
        "strength [mV]",
        "named right",
        "of the visible",
        "right or rightly silent",
    ]
    shown = [
        [f"`{row['effect']}`", "yes" if row["dynamic"] else "no", f"{row['strength_millivolt']:g}"]
        + [percent(row[name]) for name in ("right", "visible", "content")]
        for row in rows
    ]
    return lines(header, shown)


def _shares(shares):
    return lines(["answer", "share"], [[one.name, percent(one)] for one in shares])


def _rankings(rows):
    header = ["ranking by", "right class of visible dynamic effects", "false names", "false alarms"]
    names = ("right", "false_names", "alarms")
    return lines(header, [[WORDS[r["method"]], *(percent(r[n]) for n in names)] for r in rows])


def _groups(rows):
    header = [
        "what was logged",
        "first name right, of visible effects",
        "right, ties counted",
        "right name in the right branch",
        "an extra name",
        "alarms on healthy groups",
        "a branch's sensor named, of all groups",
    ]
    names = ("first", "right", "branch", "extra", "alarms", "sensors")
    return lines(header, [[LOGGED[r["method"]], *(percent(r[n]) for n in names)] for r in rows])


def _controls(rows):
    header = [
        "term",
        "named, of cells with one visible effect",
        "named, of healthy cells",
        "gap closed, median",
    ]
    shown = [
        [WORDS[row["method"]], percent(row["named"]), percent(row["named_healthy"])]
        + [f"{100 * row['gap_closed']:.1f} %" if row["gap_closed"] == row["gap_closed"] else "–"]
        for row in rows
    ]
    return lines(header, shown)


def _misses(rows):
    header = ["cell", "hidden", "mV", "verdict", "said", "outcome", "reason"]
    names = ["cell", "hidden", "strength_millivolt", "verdict", "said", "outcome", "reason"]
    return lines(header, [[row[name] for name in names] for row in rows])
