"""The benchmark's page, in Markdown: goals beside what was measured, and every table."""

from pathlib import Path

import numpy as np

from effect_benchmark import scoring
from figures import style

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

Made by `snakemake missing_effect_benchmark`, put here by `lab/tools/publish_benchmark.py`;
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
    searched = table[table["method"] == "search"]
    silent = int(searched["verdict"].isna().sum())
    parts = [
        INTRODUCTION.format(options=options, cells=len(searched), silent=silent),
        "## Goals\n\n" + _goals(scoring.goals(table)),
        "## Power\n\n![Power against strength](effect-power.svg)\n\n"
        + _power(scoring.power(table)),
        "## Confusion\n\n![Hidden against answered](effect-confusion.svg)\n",
        "## The true class left out of the library\n\n"
        "The right answer is unknown; at 1 mV, silence often is, too.\n\n"
        + _shares(scoring.left_out(table)),
        "## Other ways of ranking, on the same cells\n\n" + _rankings(scoring.rankings(table)),
        "## Terms that must not help\n\n"
        "Each refitted beside the plain model, with the noise of the search's first round, and\n"
        "held against the same gates. Charge that passed is the same in any order: of effects\n"
        "that follow it (leakage, efficiency, capacity), much survives another order.\n\n"
        + _controls(scoring.controls(table)),
        "## Parallel groups\n\n"
        "Each group is held against models of its cells by themselves. The strength is what a\n"
        "branch current has of its own, times that cell's resistance. Without branch currents\n"
        "a verdict is at best ambiguous, and its first name a guess.\n\n"
        + _groups(scoring.groups(table)),
        "## Where it is wrong\n\n" + _misses(scoring.misses(table)),
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
    rows = [[goal.name, _wanted(goal), _measured(goal), MARK[goal.reached]] for goal in goals]
    return lines(["what", "goal", "measured", "reached"], rows)


def _wanted(goal):
    if not goal.side:
        return "–"
    sign = {"at least": "≥", "at most": "≤"}[goal.side]
    return f"{sign} {goal.wanted:g} s" if _seconds(goal) else f"{sign} {100 * goal.wanted:g} %"


def _measured(goal):
    if isinstance(goal, scoring.Share):
        return percent(goal)
    if not goal.of:
        return "not measured"
    value = f"{goal.value:.2f} s" if _seconds(goal) else f"{100 * goal.value:.1f} %"
    return f"{value}, of {goal.of}"


def _seconds(goal):
    return getattr(goal, "unit", "") == "s"


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
    return lines(["answer", "share"], [[share.name, percent(share)] for share in shares])


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


STRENGTHS = (1.0, 2.5, 6.0)
PANEL_WORDS = {"right": "named right", "content": "named right, or rightly silent"}
ACROSS = 5  # panels beside each other


def confusion(table):
    """Counts of cells: hidden class (rows) against the first answer (columns)."""
    counts = scoring.confusion(table)
    rows, columns = counts.shape
    drawn, axes = style.subplots(width=2.6 + 0.31 * columns, height=2.3 + 0.27 * rows)
    axes = axes[0, 0]
    shares = counts.to_numpy(float) / counts.sum(axis=1).to_numpy(float)[:, None]
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (row, column), number in np.ndenumerate(counts.to_numpy()):
        if number:
            ink = "white" if shares[row, column] > 0.6 else style.INK
            look = {"ha": "center", "va": "center", "fontsize": 7.5, "color": ink}
            axes.text(column, row, str(number), **look)
    axes.set_xticks(range(columns), _plain(counts.columns), rotation=90)
    axes.set_yticks(range(rows), _plain(counts.index))
    axes.grid(False)
    axes.set(xlabel="first answer", ylabel="hidden", title="Cells by what was hidden and said")
    return drawn


def power(table):
    """Share of cells named right over the strength, one panel an effect, 95 % Wilson bars."""
    rows = scoring.power(table)
    names = list(dict.fromkeys(row["effect"] for row in rows))
    down = max(-(-len(names) // ACROSS), 1)
    drawn, axes = style.subplots(
        down, ACROSS, width=10.5, height=1.9 * down, sharex=True, sharey=True
    )
    for panel, name in zip(axes.flat, names, strict=False):
        _panel(panel, name, [row for row in rows if row["effect"] == name])
    for panel in axes.flat[len(names) :]:
        panel.set_visible(False)
    legend = drawn.axes[0].get_legend_handles_labels()
    # On the line of the title, which the layout keeps free.
    drawn.suptitle("Share of cells over the strength of what is hidden", x=0.01, ha="left")
    drawn.legend(*legend, loc="upper right", ncols=2)
    for panel in axes[:, 0]:
        panel.set_ylabel("share [%]")
    for panel in axes[-1]:
        panel.set_xlabel("strength [mV]")
    return drawn


def _panel(axes, name, rows):
    """Share of one effect over strength: named right, and (open marks) right or rightly silent."""
    for key, colour, mark, shift in (
        ("content", style.QUIET, "o", 1.06),
        ("right", "#0b6fb8", "s", 1),
    ):
        shares = [row[key] for row in rows]
        at = np.array([row["strength_millivolt"] for row in rows]) * shift
        value = np.array([100 * share.share for share in shares])
        low, high = 100 * np.array([share.interval for share in shares]).T
        reach = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
        open_mark = {"markerfacecolor": "white"} if key == "content" else {}
        look = {"color": colour, "capsize": 2, "label": PANEL_WORDS[key]} | open_mark
        axes.errorbar(at, value, yerr=reach, fmt=mark, **look)
    dynamic = rows[0]["dynamic"]
    axes.set_title(
        name.replace("_", " "), fontsize=7.5, color=style.INK if dynamic else style.QUIET
    )
    axes.set_xscale("log")
    axes.set_xticks(STRENGTHS, [f"{s:g}" for s in STRENGTHS])
    axes.minorticks_off()
    axes.set(ylim=(-4, 104), xlim=(0.7, 9))


def _plain(names):
    return [str(name).replace("_", " ") for name in names]
