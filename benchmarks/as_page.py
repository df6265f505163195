"""The measured numbers as a page: machine, versions, a table per topic."""

import importlib.metadata
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
HEAD = """# Benchmarks

Made by `benchmarks/run --write`, which times everything in one run on one machine; code in
[benchmarks](../benchmarks), peers pinned in
[environment-benchmarks.lock](../environment-benchmarks.lock).

CPU time, the median of 5 to 21 runs after one to warm up, all threads and child processes counted.
"Times ours" compares within this run. Accuracy stands beside every time, judged alike.

**What the ratios mean.** PyBaMM and PyBOP solve any system of equations, and scipy's solvers too:
beside them stands a recurrence that is exact for this one kind of circuit. Such ratios compare a
special-purpose kernel with general tools and say nothing about these tools at what they are for.
Compared are scipy's lfilter and least_squares, lmfit, pandas and pyarrow. Of our kernels,
compiled C runs here; without a C compiler the numpy forms serve, slower, up to 700 times.
"""

FOOT = """## Where this is not what one might expect

* **Simulation** at 10,000 samples: a call costs 11 to 16 µs by itself (checks of the tables and the
  steps, 16 arguments handed to C), a quarter of the whole there; the long record shows the kernel.
  On a uniform step the states wait for themselves once in four samples, and what is left is the
  work: a place in the table, four values read there, the count of charge.
* **Fit**: ours finds its start by itself and gives covariance and a verdict; that is in its time.
  Three passes over all samples take a third of it, 5 ns a sample each; the rest are numpy calls,
  most of them on five numbers. PyBOP is given a tolerance of 1e-6, since with its own solver
  settings the voltage at the true parameters is up to 64 mV off. Its optimiser has not arrived
  after the iterations it was granted, and it had a tenth of the samples: its ratio is a lower
  bound.
* **Filter**: a step of the recursion waits for the one before in one chain: place in the table,
  predicted voltage, innovation, gain (a division), SoC. By the latencies of these operations that
  is 90 to 100 cycles of the processor, about the goal. With the same three states it is no better
  here, where the model is exact. What the pipeline runs has four states more, for errors that a
  model of a real cell makes.
* **dQ/dV**: the default fits a curve and chooses its own smoothing, in 21 fits of 300 cells; it
  keeps the height of narrow peaks, which this record of broad ones does not ask for. The binned
  filter is the fast one: the mean of all rows in a bin is no single row's rounding.
* **ampworks** fits a spline to a sum of squared residuals that its user states. All 200,000 rows
  took it a minute; so it has 1,000 of them, by its own thinning, and single rows' rounding stays.
* **Impedance**: the search from a given start is a tenth of our time; that from several starts,
  checks, covariance and correlations are the rest, and are not in scipy's.
* **Reading**: ours is pyarrow's parser too; it also finds the layout and checks the rows.
* **cellpy** is the newest release for this Python (3.11 and 3.12: 1.0; 2 needs 3.13). Its dQ/dV
  interpolates and smooths by its own settings; only its scaling to the half cycle's charge is off.
* **PyProBE** is compared in dQ/dV; its readers know cyclers' files, not the one that is read here.
* **liionpack** solves the network of a step, and our cells stand in place of PyBaMM's: its ratio
  tells what the network costs, not what its simulation of a pack does.

Licences: numpy, scipy, lmfit, pandas, PyBaMM, PyBOP and PyProBE BSD 3-clause; pyarrow Apache 2.0;
filterpy, cellpy, impedance.py and liionpack MIT. PyBaMM, PyBOP, PyProBE, filterpy, cellpy,
impedance.py and liionpack are in the environment of the benchmarks only, as is what they need:
casadi, lcapy, paramiko and PyGithub are under the LGPL, text-unidecode under the Artistic License
or the GPL.
"""


def heading():
    """What stands above the tables."""
    versions = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    return f"{HEAD}\nMachine: {machine()}. Python {platform.python_version()}, {versions}.\n"


def section(topic, found):
    """One topic as a Markdown section; the first entry is what the others are divided by."""
    per = f", per {topic.unit}" if topic.units > 1 else ""
    lines = [
        f"## {topic.title}",
        "",
        f"{topic.work}. Accuracy: {topic.accuracy}.",
        "",
        f"| by | CPU time{per} | times ours | accuracy |",
        "| --- | --- | --- | --- |",
    ]
    for one in found:
        ratio = one.second / found[0].second
        time = _time(one.second / topic.units)
        name = f"{one.entry.name} ({one.entry.note})" if one.entry.note else one.entry.name
        lines.append(f"| {name} | {time} | {_rounded(ratio)} | {one.accuracy} |")
    lines += [f"| {name} | – | – | not run: {reason} |" for name, reason in topic.skipped]
    return "\n".join([*lines, "", *_goals(topic, found)])


def _goals(topic, found):
    """Lines that say which goals of the topic are met and which are missed."""
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
        lines.append(f"* Goal of {goal.name}: at most {words}: {told}.")
    return [*lines, ""] if lines else []


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
