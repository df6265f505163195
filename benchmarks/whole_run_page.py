"""Whole runs for benchmarks/README.md: tables and a picture of what is kept of each."""

import io
import json
from pathlib import Path

import matplotlib
import matplotlib.style
from matplotlib.figure import Figure

KEPT = Path(__file__).parent / "whole_runs"
KINDS = ("import", "files", "numerics", "figures", "other")
WORDS = {
    "import": "imports",
    "files": "reading, writing, checksums",
    "numerics": "numerics",
    "figures": "figures",
    "other": "tables, report, start of a script",
    "server": "imports of the warm executor's server",
    "snakemake": "Snakemake itself",
}


def runs() -> dict:
    """The records of all runs that are kept, by the campaign's name."""
    return {path.stem: json.loads(path.read_bytes()) for path in sorted(KEPT.glob("*.json"))}


def tables() -> str:
    """A section for each campaign, in Markdown."""
    return "\n".join(_section(name, run) for name, run in runs().items())


def parts(run) -> dict:
    """CPU time of a run by kind of work [s]: of its scripts, the server, Snakemake itself.

    What no sample has counted (processes that a script starts, the end of a script) is `other`.
    """
    sums = dict.fromkeys(WORDS, 0.0)
    for rule in run["rules"].values():
        if rule["process"] != "script":
            sums[rule["process"]] += rule["cpu_second"]
            continue
        for kind in KINDS:
            sums[kind] += rule[kind]
        sums["other"] += max(0.0, rule["cpu_second"] - sum(rule[kind] for kind in KINDS))
    return sums


def _section(name, run) -> str:
    sums = parts(run)
    total = sum(sums.values())
    shares = ", ".join(f"{WORDS[kind]} {second / total:.0%}" for kind, second in sums.items())
    warning = ["**Other work ran at the same time: to be measured again on an idle machine.**", ""]
    busy = warning if run["load_before"] > 1.0 else []
    lines = [
        f"### {name}",
        "",
        f"{run['cells']} cells, {total:.1f} s of CPU ({total / run['cells']:.2f} s a cell), "
        f"{run['wall_second']:.0f} s of wall time with --cores {run['cores']}, load "
        f"{run['load_before']} before and {run['load_after']} after. A second run, with nothing to "
        f"do: {run['again_cpu_second']:.1f} s of CPU. Machine: {run['machine']}.",
        "",
        *busy,
        f"Of the CPU time: {shares}.",
        "",
        "| rule | jobs | CPU s | ms a job | imports | files | numerics | figures | peak MB |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    return "\n".join([*lines, *[_row(rule, about) for rule, about in run["rules"].items()], ""])


def _row(rule, about) -> str:
    second, script = about["cpu_second"], about["process"] == "script"
    shares = [
        f"{about[kind] / second:.0%}" if script and second else "–"
        for kind in ("import", "files", "numerics", "figures")
    ]
    name = f"`{rule}`" if script else rule
    each = f"{1e3 * second / about['jobs']:.0f}"
    memory = f"{about['memory_megabyte']:.0f}"
    return f"| {' | '.join([name, str(about['jobs']), f'{second:.1f}', each, *shares, memory])} |"


def picture() -> bytes:
    """An SVG with a bar for each campaign: seconds of CPU a cell, by kind of work."""
    kept = runs()
    # Whatever style others have set: the picture is committed.
    with matplotlib.style.context("default"):
        figure = Figure(figsize=(9.0, 1.2 + 0.5 * len(kept)), layout="constrained")
        axes = figure.subplots()
        for row, run in enumerate(kept.values()):
            start = 0.0
            for colour, (kind, second) in enumerate(parts(run).items()):
                width = second / run["cells"]
                label = WORDS[kind] if row == 0 else None
                axes.barh(row, width, left=start, color=f"C{colour}", label=label)
                start += width
        axes.set_yticks(range(len(kept)), list(kept))
        axes.invert_yaxis()
        axes.set_xlabel("CPU time a cell [s]")
        figure.legend(loc="outside upper center", ncols=4, fontsize=8, frameon=False)
        matplotlib.rcParams["svg.hashsalt"] = "cellwright"
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()
