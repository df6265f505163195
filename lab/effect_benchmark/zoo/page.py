"""The zoo's page, in Markdown: a row a part, what is wrong, and a picture."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from effect_benchmark.page import lines, percent
from effect_benchmark.scoring import Share
from effect_benchmark.zoo import judging
from figures import style
from virtual_lab.zoo.parts import PARTS

INTRODUCTION = """# The zoo: the search judged on cells by several hands

Made by `snakemake zoo`; nothing on this page is written by hand. Each part is searched through the
public interface as a run of the pipeline does it, and one judge holds the verdicts against what was
hidden. An effect is visible where it raises what a refitted plain circuit leaves, noise included,
by 1.15 (fitted records) or 1.3 (records that judge). Shares have 95 % Wilson intervals. {options}.
"""
CLOSED = ("gap closed, median", "gap closed, lowest tenth")


def markdown(rows: list, skipped: dict[str, str], options: str) -> str:
    """The page.

    Parameters
    ----------
    rows : judging.Judged of all parts. skipped : why a part was not made, by its name.
    options : seed and sizes, in words.
    """
    tables = _by_part(rows)
    parts = [
        INTRODUCTION.format(options=options),
        "## Parts\n\n" + lines(["part", "cells", "what they are"], _about(tables, skipped)),
        "## Goals\n\n![Shares beside the goals](zoo.svg)\n\n" + _goals(tables),
        "## Said probabilities\n\n" + _calibration(rows),
        "## Strength\n\nVisible and invisible effects named right.\n\n" + _strengths(rows),
        "## Where it is wrong\n\n" + _wrong(rows),
    ]
    return "\n".join(parts)


def save(rows, skipped, options: str, job, path):
    """Write the page as one of a job's outputs."""
    Path(path).write_text(markdown(rows, skipped, options), encoding="utf-8")
    job.saved.add(path)


def _by_part(rows):
    """Judged cells by part, in the order of the table of parts; others behind."""
    names = [*PARTS, *dict.fromkeys(row.part for row in rows if row.part not in PARTS)]
    tables = {name: [row for row in rows if row.part == name] for name in names}
    return {name: own for name, own in tables.items() if own}


def _about(tables, skipped):
    made = [
        [f"`{name}`", len(own), PARTS[name].about if name in PARTS else ""]
        for name, own in tables.items()
    ]
    return made + [[f"`{name}`", "–", f"skipped: {why}"] for name, why in skipped.items()]


def _goals(tables):
    by_part = {name: judging.shares(own, name) for name, own in tables.items()}
    if not by_part:
        return "No part was made.\n"
    rows = [
        [shares[0].name, _wanted(shares), *(_measured(one) for one in shares)]
        for shares in zip(*by_part.values(), strict=True)
    ]
    return lines(["what", "goal", *(f"`{name}`" for name in by_part)], rows)


def _wanted(shares):
    """The goal of all parts, or where they differ that of each."""
    goals = [_goal(one) for one in shares]
    return goals[0] if len(set(goals)) == 1 else ", ".join(goals)


def _goal(one):
    if not one.side or one.wanted != one.wanted:
        return "–"
    sign = {"at least": "≥", "at most": "≤"}[one.side]
    seconds = getattr(one, "unit", "") == "s"
    return f"{sign} {one.wanted:g} s" if seconds else f"{sign} {100 * one.wanted:g} %"


def _measured(one):
    if not one.of:
        return "–"
    mark = {True: "", False: " **missed**", None: ""}[one.reached]
    if isinstance(one, Share):
        return percent(one) + mark
    value = f"{one.value:.2f} s" if one.unit == "s" else f"{100 * one.value:.1f} %"
    return f"{value}, of {one.of}{mark}"


def _calibration(rows):
    bins = judging.calibration(rows)
    if not bins:
        return "The verdicts say no probabilities.\n"
    return lines(
        ["said, mean", "right"], [[f"{one['said']:.2f}", percent(one["right"])] for one in bins]
    )


EDGES_MILLIVOLT = (0.0, 2.2, 4.5, 10.0, np.inf)


def _strengths(rows):
    """Single effects named right, by part and by what they leave on the records that judge."""
    single = [row for row in rows if row.kind == "single"]
    names = list(dict.fromkeys(row.part for row in single))
    return lines(
        ["left of the effect [mV]", *(f"`{name}`" for name in names)],
        [
            [f"{low:g} to {high:g}", *(percent(_named(single, name, low, high)) for name in names)]
            for low, high in pairwise(EDGES_MILLIVOLT)
        ],
    )


def _named(rows, part, low, high):
    mine = [row for row in rows if row.part == part and low <= row.strength_millivolt < high]
    return Share("right", sum(judging.is_right(row) for row in mine), len(mine))


def _wrong(rows):
    header = [
        "part",
        "cell",
        "hidden",
        "form",
        "mV",
        "verdict",
        "said",
        "outcome",
        "why",
        "sentence",
    ]
    return lines(
        header,
        [
            [row.part, row.cell, row.hidden, row.form, f"{row.strength_millivolt:.1f}"]
            + [row.verdict or "–", row.said or "–", _outcome(row), row.against or "–", row.sentence]
            for row in judging.wrong(rows)
        ],
    )


def _outcome(row):
    return f"{row.outcome}, {row.extra} extra" if row.extra else row.outcome


DRAWN = 6  # shares that have a panel each: right, false, extra, healthy, sheet, outside


def picture(rows: list):
    """Shares of each part with 95 % Wilson bars, one panel a goal; the goal as a line."""
    tables = _by_part(rows)
    by_part = {name: judging.shares(own, name)[:DRAWN] for name, own in tables.items()}
    drawn, axes = style.subplots(2, DRAWN // 2, width=10.0, height=4.6)
    for panel, shares in zip(axes.flat, zip(*by_part.values(), strict=True), strict=False):
        _panel(panel, list(by_part), shares)
    return drawn


def _panel(axes, names, shares):
    for place, one in enumerate(shares):
        if not one.of:
            continue
        low, high = (100 * end for end in one.interval)
        middle = 100 * one.share
        reach = [[max(middle - low, 0)], [max(high - middle, 0)]]
        axes.errorbar([place], [middle], yerr=reach, fmt="o", color="#0b6fb8", capsize=2)
        if one.side:
            axes.plot([place - 0.3, place + 0.3], [100 * one.wanted] * 2, color=style.QUIET)
    axes.set_xticks(range(len(names)), names)
    axes.set(ylim=(-4, 104), xlim=(-0.6, len(names) - 0.4), ylabel="share [%]")
    axes.set_title(shares[0].name, fontsize=7.5)
