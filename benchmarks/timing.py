"""How everything here is timed: CPU time, median of the runs, after one run to warm up."""

import importlib
import resource
import time
from typing import NamedTuple

import numpy as np

LONG_SECOND = 60.0


class Entry(NamedTuple):
    """One way of doing the work of a topic.

    name : what a reader sees. run : function without arguments that does the work. accuracy :
    function of what `run` gives → text. runs : how many are timed. note : what differs in it.
    """

    name: str
    run: object
    accuracy: object
    runs: int = 5
    note: str = ""


class Goal(NamedTuple):
    """What an entry should take at most: `second` [s] per unit, or `times` the entry named `of`."""

    name: str
    second: float = 0.0
    times: float = 0.0
    of: str = ""


class Topic(NamedTuple):
    """One table: the work that every entry does, the first entry ours; `unit` of what is divided
    by `units` (samples, steps), 1 where a run counts as a whole. skipped: (name, reason).
    goals : tuple of Goal."""

    title: str
    work: str
    accuracy: str
    entries: list
    skipped: list
    units: int = 1
    unit: str = "run"
    goals: tuple = ()


class Timed(NamedTuple):
    """Median CPU time of an entry [s] and its accuracy in words."""

    entry: Entry
    second: float
    accuracy: str


def timed(entry):
    """Run an entry once to warm up and to judge it, then as often as it says.

    Short work is repeated inside a run, so that the clock's own step does not show. Work of a
    minute or more is not run again: nothing of it is still to be warmed up.
    """
    begin = cpu_second()
    result = entry.run()
    first = cpu_second() - begin
    if first > LONG_SECOND:
        return Timed(entry, first, entry.accuracy(result))
    inside = max(1, int(2e-3 / max(first, 1e-6)))
    found = []
    for _ in range(entry.runs):
        begin = cpu_second()
        for _ in range(inside):
            entry.run()
        found.append((cpu_second() - begin) / inside)
    return Timed(entry, float(np.median(found)), entry.accuracy(result))


def cpu_second():
    """CPU time of this process with all its threads, and of its children that have ended [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def where_importable(names, makers):
    """Entries whose packages are there, and (name, reason) of the others.

    Parameters
    ----------
    names : name of the entry → tuple of modules that it needs.
    makers : name of the entry → function () → Entry.
    """
    entries, skipped = [], []
    for name, maker in makers.items():
        reason = missing(names.get(name, ()))
        if reason:
            skipped.append((name, reason))
        else:
            entries.append(maker())
    return entries, skipped


def missing(modules):
    """Why one of the modules cannot be imported; empty where all can."""
    for module in modules:
        try:
            importlib.import_module(module)
        except ImportError as error:
            return f"{module} cannot be imported: {error}"
    return ""


def millivolt(found, true):
    """Largest difference of two voltages, as text."""
    return f"{1e3 * np.max(np.abs(found - true)):.2g} mV"
