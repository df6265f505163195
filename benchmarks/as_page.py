"""The measured numbers as tables of benchmarks/README.md: machine, versions, a table per topic."""

import importlib.metadata
import json
import os
import platform
from pathlib import Path

PACKAGES = (
    "numpy",
    "scipy",
    "lmfit",
    "filterpy",
    "pybamm",
    "pybop",
    "pandas",
    "pyarrow",
    "impedance",
    "cellpy",
    "pyprobe-data",
    "liionpack",
    "ampworks",
)
KEPT = Path(__file__).parent / "measured.json"


def measured(topics: list) -> dict:
    """What is kept of a run: the machine, versions of the packages, every topic."""
    versions = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    python = f"Python {platform.python_version()}"
    return {"machine": machine(), "versions": f"{python}, {versions}", "topics": topics}


def topic_measured(topic, found) -> dict:
    """One topic as it is kept: seconds of CPU per unit, accuracy in words."""
    rows = [
        {
            "name": f"{one.entry.name} ({one.entry.note})" if one.entry.note else one.entry.name,
            "second": one.second / topic.units,
            "accuracy": one.accuracy,
        }
        for one in found
    ]
    return {
        "title": topic.title,
        "work": topic.work,
        "accuracy": topic.accuracy,
        "unit": topic.unit if topic.units > 1 else "",
        "rows": rows,
        "skipped": [{"name": name, "reason": reason} for name, reason in topic.skipped],
        "goals": _goals(topic, found),
    }


def tables() -> str:
    """All tables of the last run that was kept, in Markdown."""
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    head = f"Machine: {kept['machine']}. {kept['versions']}.\n"
    return "\n".join([head, *map(section, kept["topics"])])


def section(topic: dict) -> str:
    """One topic in Markdown; the first entry is what the others are divided by."""
    per = f", per {topic['unit']}" if topic["unit"] else ""
    lines = [
        f"### {topic['title']}",
        "",
        f"{topic['work']}. Accuracy: {topic['accuracy']}.",
        "",
        f"| by | CPU time{per} | times ours | accuracy |",
        "| --- | --- | --- | --- |",
    ]
    for row in topic["rows"]:
        ratio = _rounded(row["second"] / topic["rows"][0]["second"])
        lines.append(f"| {row['name']} | {_time(row['second'])} | {ratio} | {row['accuracy']} |")
    lines += [f"| {one['name']} | – | – | not run: {one['reason']} |" for one in topic["skipped"]]
    return "\n".join([*lines, "", *(f"* {goal}" for goal in topic["goals"]), ""])


def _goals(topic, found) -> list[str]:
    """Sentences that say which goals of the topic are met and which are missed."""
    seconds = {one.entry.name: one.second / topic.units for one in found}
    lines = []
    for goal in topic.goals:
        if goal.name not in seconds or (goal.of and goal.of not in seconds):
            continue
        limit = goal.times * seconds[goal.of] if goal.of else goal.second
        words = f"{goal.times:g} times {goal.of}" if goal.of else _time(limit)
        told = (
            "met" if seconds[goal.name] <= limit else f"missed by {seconds[goal.name] / limit:.2g}×"
        )
        lines.append(f"Goal of {goal.name}: at most {words}: {told}.")
    return lines


def _time(second):
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if second >= size:
            return f"{second / size:.3g} {unit}"
    return f"{second * 1e9:.3g} ns"


def _rounded(ratio):
    return f"{ratio:.2g}" if ratio < 100 else f"{float(f'{ratio:.2g}'):,.0f}"


def _version(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def machine():
    """Processor and cores, without the name of the machine."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text(encoding="utf-8").splitlines() if about.exists() else []
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    processor = models[0] if models else platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()}"
