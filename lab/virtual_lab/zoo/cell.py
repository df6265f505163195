"""A behavioural cell and its meter: what healthy ones are, and where effects enter."""

from typing import NamedTuple

import numpy as np

from virtual_lab.behaviour import Rating
from virtual_lab.zoo import half_cells

COURSE = np.linspace(0.0, 1.0, 201)  # SoC of all courses but the OCV
PLAY_SOC = np.array([0.003, 0.008, 0.02, 0.045, 0.09])  # half widths of the play operators
ONE, NONE = np.ones(COURSE.size), np.zeros(COURSE.size)


class Cell(NamedTuple):
    """Parameters of a cell; neutral values are those of a cell without effects.

    Electrical: `ocv` [V] over half_cells.SOC; `ampere_hour`; `r` [ohm] of the ohmic element and of
    three RC pairs of time constants `tau` [s]; `course` their factors over COURSE; `on_charge` the
    share by which the ohmic element is larger on charge, over COURSE; `energy` [J/mol] of each
    element, by the temperature of the core, and `own_energy` by the core's rise over the chamber.
    Kinetics: `exchange_ampere` (0: none) times `exchange_course`, of symmetry `symmetry` [1].
    Diffusion: `depletion_volt` per unit of surface depletion at `diffusion_second`, which falls by
    exp(`diffusion_slope` × (SoC − ½)).
    Hysteresis: `play_volt` of each width of PLAY_SOC; `loop_volt`, reached at `loop_per_soc` [1];
    `gap_volt` by the sign of the last current.
    Charge: `leak` [A] over COURSE; `lost_share` of what is charged; `ampere_hour_bend` (share,
    kelvin): capacity × (1 + share × tanh((T − 25 °C)/kelvin)). `entropy` [V/K] over COURSE.
    Heat: `core` and `can` (thermal resistance [K/W], time constant [s]).
    Outside the vocabulary: `contact` (more resistance [ohm] above a current [A]); `growth` of the
    ohmic element from the first test to the last; `plating_volt` of the plateau after cold charge.
    """

    rating: Rating
    chemistry: str
    ocv: np.ndarray
    ampere_hour: float
    r: tuple[float, float, float, float]
    tau: tuple[float, float, float]
    course: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    energy: tuple[float, float, float, float]
    own_energy: float = 0.0
    on_charge: np.ndarray = NONE
    exchange_ampere: float = 0.0
    exchange_course: np.ndarray = ONE
    symmetry: float = 0.5
    depletion_volt: float = 0.0
    diffusion_second: float = 2e4
    diffusion_slope: float = 0.0
    play_volt: tuple[float, ...] = (0.0,) * len(PLAY_SOC)
    loop_volt: float = 0.0
    loop_per_soc: float = 20.0
    gap_volt: float = 0.0
    leak: np.ndarray = NONE
    lost_share: float = 0.0
    ampere_hour_bend: tuple[float, float] = (0.0, 10.0)
    entropy: np.ndarray = NONE
    core: tuple[float, float] = (0.4, 60.0)
    can: tuple[float, float] = (1.2, 700.0)
    contact: tuple[float, float] = (0.0, 1e9)
    growth: float = 0.0
    plating_volt: float = 0.0


class Meter(NamedTuple):
    """The measuring channel and what the sheets say of it; neutral by default.

    `offset_ampere` and the share of it that fades with `warm_second`; `skew_second`: the voltage
    shown is that of so long ago; `offset_volt`, `gain_volt` [1]; `drift_volt` over each test;
    `inductive_volt` per ampere and second; `ripple` (amplitude [V], period [s]); `file_volt`:
    offset of one drive alone; `start_soc`: by how much one drive starts below what the sheet says;
    `sheet_kelvin`: error of the sheet about one drive's temperature; `rating_share`: of the rating.
    """

    white_volt: float
    offset_ampere: float = 0.0
    warm_share: float = 0.0
    warm_second: float = 1800.0
    skew_second: float = 0.0
    offset_volt: float = 0.0
    gain_volt: float = 0.0
    drift_volt: float = 0.0
    inductive_volt: float = 0.0
    ripple: tuple[float, float] = (0.0, 1200.0)
    file_volt: float = 0.0
    start_soc: float = 0.0
    sheet_kelvin: float = 0.0
    rating_share: float = 0.0


class Specimen(NamedTuple):
    """A cell, its meter, and the cell as it was at its capacity and slow tests, where it differs.

    `slow_volt`: error of the OCV in the slow test [V] over half_cells.SOC. `held`: whether the slow
    charge ends with a hold. `start_soc`: true SoC at the start of each test.
    """

    cell: Cell
    meter: Meter
    slow_volt: np.ndarray
    held: bool
    start_soc: tuple[float, ...]
    earlier: Cell | None = None

    def with_cell(self, **changes) -> "Specimen":
        """The specimen with other parameters of its cell."""
        return self._replace(cell=self.cell._replace(**changes))

    def with_meter(self, **changes) -> "Specimen":
        """The specimen with another meter."""
        return self._replace(meter=self.meter._replace(**changes))


class Kind(NamedTuple):
    """What cells of a chemistry are like: rated charge [Ah], overpotentials [V] at 1C.

    The overpotentials are those of the ohmic element and of a fast and a slow pair.
    """

    ampere_hour: float
    ohmic_volt: float
    fast_volt: float
    slow_volt: float


KINDS = {
    "NMC": Kind(4.8, 0.085, 0.045, 0.055),
    "NCA": Kind(3.2, 0.095, 0.05, 0.05),
    "LFP": Kind(2.6, 0.05, 0.03, 0.035),
}
TESTS_OF_CELL = 8


def healthy(random: np.random.Generator, chemistry: str) -> Specimen:
    """A healthy cell with everyday physics, drawn.

    Its elements depend on SoC and temperature by a few per cent, the slow pair is two pairs in half
    of the cells, each test starts up to 1 % below full, and the slow test shows the OCV to 0.5 mV.
    """
    kind = KINDS[chemistry]
    low, high = half_cells.CUTOFFS_VOLT[chemistry]
    rating = Rating(kind.ampere_hour, low, high)
    volt = np.array([kind.ohmic_volt, kind.fast_volt, kind.slow_volt])
    ohm = volt / kind.ampere_hour * np.exp(random.normal(0.0, 0.15, 3))
    second = np.array([9.0, 110.0]) * np.exp(random.normal(0.0, 0.25, 2))
    split = random.uniform(0.15, 0.3) if random.random() < 0.5 else 0.0
    shift = random.normal(0.0, 0.004, 2)
    cell = Cell(
        rating=rating,
        chemistry=chemistry,
        ocv=half_cells.open_circuit_volt(chemistry, empty_shift=abs(shift[0]), full_shift=shift[1]),
        ampere_hour=kind.ampere_hour * (1 + random.normal(-0.01, 0.02)),
        r=(ohm[0], ohm[1], ohm[2] * (1 - split), ohm[2] * split),
        tau=(second[0], second[1], 3.2 * second[1]),
        course=tuple(_mild_course(random) for _ in range(4)),
        energy=tuple(random.uniform(300.0, 1500.0, 4).tolist()),
    )
    return Specimen(
        cell,
        Meter(white_volt=random.uniform(1e-3, 2e-3)),
        slow_volt=0.5e-3 * _smooth(random, half_cells.SOC),
        held=bool(random.random() < 0.5),
        start_soc=tuple((1.0 - random.uniform(0.0, 0.01, TESTS_OF_CELL)).tolist()),
    )


def _mild_course(random):
    """Factor over COURSE, about 1 % from one in the root mean square."""
    return 1.0 + 0.01 * _smooth(random, COURSE)


def _smooth(random, soc):
    """A smooth function over SoC with a root mean square of one and no mean."""
    wave = np.arange(1, 5)
    size = random.normal(0.0, 1.0 / wave)
    phase = random.uniform(0.0, 2 * np.pi, (4, 1))
    shape = size @ np.sin(np.pi * np.outer(wave, soc) + phase)
    shape = shape - shape.mean()
    return shape / np.sqrt(np.mean(shape**2))
