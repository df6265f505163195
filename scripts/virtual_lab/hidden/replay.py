"""A cell driven once more by the current that an instrument showed."""

from typing import NamedTuple

import numpy as np

from virtual_lab import fast
from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import Chamber, steady
from virtual_lab.clock import sample_times
from virtual_lab.hidden.setup import Setup
from virtual_lab.protocols import Step

EDGE_SECOND = 1e-3
CLOCK = "jittery"
LONGEST_SECOND = 30.0


class File(NamedTuple):
    """One test of a cell, as far as gaps are concerned."""

    steps: list[Step]
    celsius: float
    kind: str = "drive"
    is_validation: bool = False


class Shown(NamedTuple):
    """Noise-free record: per step times [s] from its start and currents [A]; all voltages [V].

    Instants at edges are there to say what the current did; only `sampled` ones were measured.
    """

    steps: list[tuple[np.ndarray, np.ndarray]]
    volt: np.ndarray
    sampled: np.ndarray


def shown(file: File, setup: Setup) -> Shown:
    """What a perfect instrument but for the setup's faults would show of a test."""
    cell = (setup.at_capacity_test if file.kind == "capacity" else None) or setup.cell
    behaviours = fast.run(file.steps, cell, chamber=steady(file.celsius))
    pairs = list(zip(behaviours, file.steps, strict=True))
    both = [_samples(behaviour.duration_second, step) for behaviour, step in pairs]
    times = [second for _, second in both]
    chain = setup.chain
    currents = [
        b.current(second) * (1 + chain.current_gain) + chain.current_offset_ampere
        for b, second in zip(behaviours, times, strict=True)
    ]
    volt = _shown_volt(behaviours, times, currents, setup)
    sampled = np.concatenate([np.isin(second, measured) for measured, second in both])
    return Shown(list(zip(times, currents, strict=True)), volt, sampled)


def answer(record: Shown, file: File, setup: Setup, *, initial_soc: float = 1.0) -> np.ndarray:
    """Voltage [V] that a setup would show if its instrument had shown the record's current."""
    chain = setup.chain
    cell = (setup.at_capacity_test if file.kind == "capacity" else None) or setup.cell
    truly = [
        (second, (ampere - chain.current_offset_ampere) / (1 + chain.current_gain))
        for second, ampere in record.steps
    ]
    behaviours = driven(truly, cell, steady(file.celsius), initial_soc=initial_soc)
    times, currents = zip(*record.steps, strict=True)
    return _shown_volt(behaviours, times, currents, setup)


def driven(
    currents: list[tuple[np.ndarray, np.ndarray]],
    cell: fast.Cell,
    chamber: Chamber,
    *,
    initial_soc: float = 1.0,
) -> list[Behaviour]:
    """Behaviours of a cell under currents [A] at times [s] of each step."""
    steps = [Step("profile", np.column_stack(pair), pair[0][-1], np.inf) for pair in currents]
    return fast.run(steps, cell, chamber=chamber, initial_soc=initial_soc)


def soc_of(record: Shown, file: File, setup: Setup) -> np.ndarray:
    """State of charge [1] of a healthy cell at the record's samples."""
    behaviours = driven(record.steps, setup.cell, steady(file.celsius))
    times = [second for second, _ in record.steps]
    return np.concatenate([b.soc(second) for b, second in zip(behaviours, times, strict=True)])


def corners(duration_second: float, step: Step) -> np.ndarray:
    """Instants [s] of a step between which its current runs nearly straight."""
    regular = np.arange(0.0, duration_second, min(step.period_second, LONGEST_SECOND))
    ends = [0.0, EDGE_SECOND, duration_second]
    if step.kind == "profile":
        ends += step.value[step.value[:, 0] < duration_second, 0].tolist()
    return np.union1d(regular, ends)


def _samples(duration, step):
    """Instants [s] of a step at which a sample is taken, and those with the current's corners."""
    random = np.random.default_rng(0)
    sampled = sample_times(duration, period_second=step.period_second, random=random, clock=CLOCK)
    return sampled, np.union1d(sampled, corners(duration, step))


def _shown_volt(behaviours, times, currents, setup):
    chain = setup.chain
    begins = np.cumsum([0.0, *[b.duration_second for b in behaviours]])
    second = np.concatenate([begin + t for begin, t in zip(begins, times, strict=False)])
    volt = _late(behaviours, times, begins, chain.voltage_delay_second)
    volt = volt * (1 + chain.voltage_gain) + chain.voltage_offset_volt
    if setup.disturbance:
        volt = volt + setup.disturbance(second, np.concatenate(currents))
    return volt


def _late(behaviours, times, begins, delay):
    """Voltage [V] of the whole test, each sample that of an instant earlier by a delay [s]."""
    if delay == 0.0:
        return np.concatenate([b.voltage(t) for b, t in zip(behaviours, times, strict=True)])
    second = np.concatenate([begin + t for begin, t in zip(begins, times, strict=False)])
    at = np.clip(second - delay, 0.0, begins[-1])
    which = np.clip(np.searchsorted(begins, at, side="right") - 1, 0, len(behaviours) - 1)
    volt = np.empty(at.size)
    for k in np.unique(which):
        rows = which == k
        volt[rows] = behaviours[k].voltage(at[rows] - begins[k])
    return volt
