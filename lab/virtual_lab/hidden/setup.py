"""Healthy cells and channels of the hidden campaign, their tests, noise-free records."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from virtual_lab import electrodes, fast, protocols
from virtual_lab.behaviour import Behaviour, Rating
from virtual_lab.chamber import Chamber, steady
from virtual_lab.instruments.chain import Chain, sample_times
from virtual_lab.protocols import Step

RATING = Rating(5.0, 2.5, 4.2)
CHEMISTRY = "NMC"
SOC = np.linspace(0.0, 1.0, 1001)
# Noise and spread between healthy cells as in the study of missing-effect.md.
CHAIN = Chain(
    voltage_noise_volt=1.5e-3,
    voltage_slow_noise_volt=0.5e-3,
    voltage_slow_noise_second=250.0,
    voltage_resolution_volt=0.3e-3,
    current_noise_ampere=2e-3,
    current_resolution_ampere=1e-3,
    temperature_noise_celsius=0.1,
    rest_is_open=False,
    clock="jittery",
)
NOISE_VOLT = float(np.hypot(1.5e-3, 0.5e-3))
OCV_SPREAD_VOLT = 1e-3
CAPACITY_SPREAD = 0.05
RESISTANCE_SPREAD = 0.18
TIME_SPREAD = 0.2


class Setup(NamedTuple):
    """A cell and its measuring channel.

    `at_capacity_test` is the cell during the capacity test, where it differs from later.
    `disturbance` adds to the voltage [V] at times [s] and currents [A] of a record.
    """

    cell: fast.Cell
    chain: Chain = CHAIN
    at_capacity_test: fast.Cell | None = None
    disturbance: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None

    def with_cell(self, **changes) -> "Setup":
        """The setup with other parameters of the cell."""
        return self._replace(cell=self.cell._replace(**changes))

    def with_chain(self, **changes) -> "Setup":
        """The setup with other settings of the channel."""
        return self._replace(chain=self.chain._replace(**changes))


def healthy(random: np.random.Generator) -> Setup:
    """A healthy cell: an OCV, an ohmic resistance and two RC pairs, constant over SoC.

    Capacity, resistances and time constants differ from cell to cell, and so does the OCV,
    smoothly over SoC, by 1 mV (root mean square). Nothing depends on temperature.
    """
    window = electrodes.window(CHEMISTRY, RATING)
    ocv = electrodes.open_circuit_volt(CHEMISTRY, window, SOC) + ocv_error(random)
    spread = np.exp(random.normal(0.0, [RESISTANCE_SPREAD] * 3 + [TIME_SPREAD] * 2))
    r0, r1, r2, tau1, tau2 = spread * [0.020, 0.010, 0.012, 7.0, 125.0]
    return Setup(
        fast.Cell(
            rating=RATING,
            ocv_volt=ocv,
            capacity_ampere_hour=RATING.capacity_ampere_hour
            * (1 + CAPACITY_SPREAD * random.normal()),
            r0_ohm=r0,
            pair_r_ohm=(r1, r2),
            pair_tau_second=(tau1, tau2),
        )
    )


def ocv_error(random: np.random.Generator) -> np.ndarray:
    """Deviation of a cell's OCV [V] from its type's: five cosines over SoC, weaker the shorter."""
    wave = np.arange(1, 6)
    size = random.normal(0.0, 1 / wave)
    error = size @ np.cos(np.pi * np.outer(wave, SOC) + random.uniform(0, 2 * np.pi, (5, 1)))
    return OCV_SPREAD_VOLT * error / np.sqrt(np.mean(error**2))


EDGE_SECOND = 1e-3
CLOCK = "jittery"
LONGEST_SECOND = 30.0


class File(NamedTuple):
    """One test of a cell: protocol, temperature [°C], kind, and whether it is for validation.

    In place of a protocol a test may have times [s] and currents [A] that were `measured`, from a
    state of charge [1].
    """

    steps: list[Step]
    celsius: float
    kind: str = "drive"
    is_validation: bool = False
    measured: tuple[np.ndarray, np.ndarray] | None = None
    initial_soc: float = 1.0


class Record(NamedTuple):
    """Noise-free record: per step times [s] from its start and currents [A]; all voltages [V].

    Instants at edges are there to describe the current; only `sampled` ones were measured.
    """

    steps: list[tuple[np.ndarray, np.ndarray]]
    volt: np.ndarray
    sampled: np.ndarray


def noise_free_record(file: File, setup: Setup) -> Record:
    """Noise-free record of a test, with the systematic errors of the setup's channel."""
    if file.measured:
        shown = Record([file.measured], np.zeros(0), np.ones(file.measured[0].size, bool))
        return shown._replace(volt=replayed_volt(shown, file, setup))
    behaviours = fast.run(file.steps, _cell_in(setup, file), chamber=steady(file.celsius))
    pairs = list(zip(behaviours, file.steps, strict=True))
    measured = [_sampled(behaviour.duration_second, step) for behaviour, step in pairs]
    times = [
        np.union1d(second, current_corners(behaviour.duration_second, step))
        for second, (behaviour, step) in zip(measured, pairs, strict=True)
    ]
    chain = setup.chain
    currents = [
        b.current(second) * (1 + chain.current_gain) + chain.current_offset_ampere
        for b, second in zip(behaviours, times, strict=True)
    ]
    volt = _shown_volt(behaviours, times, currents, setup)
    sampled = np.concatenate([np.isin(t, own) for own, t in zip(measured, times, strict=True)])
    return Record(list(zip(times, currents, strict=True)), volt, sampled)


def replayed_volt(
    record: Record, file: File, setup: Setup, *, lower_soc: float = 0.0
) -> np.ndarray:
    """Voltage [V] that a setup would show if its instrument had shown the record's current.

    It begins at the file's state of charge, or `lower_soc` [1] below it.
    """
    offset, gain = setup.chain.current_offset_ampere, setup.chain.current_gain
    true = [(second, (ampere - offset) / (1 + gain)) for second, ampere in record.steps]
    around = steady(file.celsius)
    start = file.initial_soc - lower_soc
    behaviours = driven_by(true, _cell_in(setup, file), around, initial_soc=start)
    times, currents = zip(*record.steps, strict=True)
    return _shown_volt(behaviours, times, currents, setup)


def _cell_in(setup, file):
    """The cell during a test: before its capacity has changed, or after."""
    return (setup.at_capacity_test if file.kind == "capacity" else None) or setup.cell


def driven_by(
    currents: list[tuple[np.ndarray, np.ndarray]],
    cell: fast.Cell,
    chamber: Chamber,
    *,
    initial_soc: float = 1.0,
) -> list[Behaviour]:
    """Behaviours of a cell for currents [A] at times [s] of each step."""
    steps = [Step("profile", np.column_stack(pair), pair[0][-1], np.inf) for pair in currents]
    return fast.run(steps, cell, chamber=chamber, initial_soc=initial_soc)


def soc_of(record: Record, file: File, setup: Setup) -> np.ndarray:
    """State of charge [1] of a healthy cell at the record's samples."""
    around, start = steady(file.celsius), file.initial_soc
    behaviours = driven_by(record.steps, setup.cell, around, initial_soc=start)
    times = [second for second, _ in record.steps]
    return np.concatenate([b.soc(second) for b, second in zip(behaviours, times, strict=True)])


def current_corners(duration_second: float, step: Step) -> np.ndarray:
    """Instants [s] of a step between which its current is nearly linear."""
    regular = np.arange(0.0, duration_second, min(step.period_second, LONGEST_SECOND))
    ends = [0.0, EDGE_SECOND, duration_second]
    if step.kind == "profile":
        ends += step.value[step.value[:, 0] < duration_second, 0].tolist()
    return np.union1d(regular, ends)


def _sampled(duration, step):
    """Instants [s] of a step at which a sample is taken."""
    random = np.random.default_rng(0)
    return sample_times(duration, period_second=step.period_second, random=random, clock=CLOCK)


def _shown_volt(behaviours, times, currents, setup):
    """Voltage [V] of a test as the channel shows it, without noise."""
    chain = setup.chain
    begins = np.cumsum([0.0, *[b.duration_second for b in behaviours]])
    second = np.concatenate([begin + t for begin, t in zip(begins, times, strict=False)])
    volt = _delayed_volt(behaviours, times, begins, chain.voltage_delay_second)
    volt = volt * (1 + chain.voltage_gain) + chain.voltage_offset_volt
    if setup.disturbance:
        volt = volt + setup.disturbance(second, np.concatenate(currents))
    return volt


def _delayed_volt(behaviours, times, begins, delay):
    """Voltage [V] of the whole test, each sample taken from an instant earlier by a delay [s]."""
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


SOFT_SEED, HARSH_SEED = 11, 29


class Task(NamedTuple):
    """A test of the campaign by name; `role` as in the sheet."""

    test: str
    kind: str
    celsius: float
    steps: list[Step]
    role: str


@cache
def tasks() -> tuple[Task, ...]:
    """Tests of every cell: capacity, HPPC, three drives to fit, two harsher ones to validate."""
    rated = RATING.capacity_ampere_hour
    full = protocols.capacity(
        RATING, repeats=1, c_rate=1 / 3, until_c_rate=1 / 50, hold_empty=True, period_second=20.0
    )
    pulses = protocols.hybrid_pulses_below_full(RATING, rated)
    soft = protocols.dynamic_load(RATING, style="soft", seed=SOFT_SEED)
    harsh = protocols.dynamic_load(RATING, style="harsh", seed=HARSH_SEED)
    return (
        Task("capacity_25C", "capacity", 25.0, full, "fit"),
        Task("hppc_25C", "hppc", 25.0, pulses, "fit"),
        Task("drive_25C", "drive", 25.0, soft, "fit"),
        Task("drive_10C", "drive", 10.0, soft, "fit"),
        Task("drive_40C", "drive", 40.0, soft, "fit"),
        Task("validation_25C", "drive", 25.0, harsh, "validation"),
        Task("validation_15C", "drive", 15.0, harsh, "validation"),
    )


def slow_task() -> Task:
    """C/20 discharge and charge, which only reference cells have."""
    steps = protocols.slow_ocv(RATING, c_rate=1 / 20, period_second=60.0)
    return Task("ocv_C20_25C", "ocv", 25.0, steps, "fit")


@cache
def gap_files() -> list[File]:
    """The same tests as files on which gaps are measured."""
    return [
        File(task.steps, task.celsius, task.kind, task.role == "validation") for task in tasks()
    ]
