"""The thesis' cells: five types (A to E), how they age, their circuits, and spectra of table 3.1.

The thesis (4.3: tables 4.1, 4.2, figures 4.8 to 4.15) gives capacities and resistances at some
cycles; monotone cubics run between them. It does not say which losses lie behind them: ASSUME the
shares in `CellType`; the lithium lost is then what explains the capacity, so that plateaus and
peaks of dQ/dV move as they must. A cell may gain capacity at first (0.5 % in 200 cycles, NCM):
lithium that comes back from the negative electrode's overhang, a negative `lli`.

Spectra are those of the circuit in table 3.1 (32 Ah LMO cell): Z = Rs + Z_CPE ‖ (Rct + Z_W) with
Z_CPE = 1/(T·(j2πf)^P) and Z_W = 1/(Y0·√(j2πf)), equations of section 3.2. The table's header is
read as 20, 10, 5, 0, −10 °C: its signs are misprinted, since only so ln Rct is a line over 1/T and
resistance grows in the cold. Rs at 5 % and −10 °C is lost in print: ASSUME 2.75 mΩ, on the
parabola in °C through the other four of its column (the same extrapolation misses the printed
values of the other two columns by 10 and 5 %).
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from virtual_lab import electrodes, fast
from virtual_lab.behaviour import Rating


class AgeingState(NamedTuple):
    """State of an aged cell: what it has lost, and how its resistance and kinetics changed.

    Losses are shares [1] of the fresh cell's lithium and materials, as `electrodes.window` takes
    them; factors [1] multiply its ohmic resistance and its exchange-current densities.
    """

    lli: float
    lam_negative: float
    lam_positive: float
    resistance_factor: float
    kinetics: float


class CellType(NamedTuple):
    """A type of cell: data sheet, capacity when fresh [Ah], ohmic resistance [ohm], losses.

    `lam_*_per_loss`: material lost per capacity lost [1], once the capacity loss exceeds
    `lam_after` [1].
    """

    chemistry: str
    rating: Rating
    fresh_ampere_hour: float
    fresh_ohm: float
    lam_negative_per_loss: float
    lam_positive_per_loss: float
    lam_after: float = 0.0


# Fresh resistances: C from "four times larger (8 mOhm)", E from table 3.1; ASSUME the others.
# LFP loses lithium only at first: that shortens the plateau of full graphite, the thesis' first
# 10 % (figures 4.15, 4.17); then graphite too, which shortens the next one.
CELL_TYPES = {
    "A": CellType("LFP", Rating(1.2, 2.5, 3.65), 1.2, 0.040, 0.8, 0.0, 0.08),
    "B": CellType("LFP", Rating(5.0, 2.0, 3.65), 5.0, 0.008, 0.8, 0.0, 0.08),
    "C": CellType("NMC", Rating(20.0, 3.0, 4.15), 19.56, 0.002, 0.4, 0.5),
    "D": CellType("NMC", Rating(30.0, 3.0, 4.05), 29.5, 0.0015, 0.4, 0.5),
    "E": CellType("LMO", Rating(32.0, 2.5, 4.2), 32.0, 0.002, 0.3, 0.6),
}


class AgeingLaw(NamedTuple):
    """Capacity and resistance over the life of a cell, and the knee, if any.

    Points are cycle, capacity [1] and resistance [1] over those of the fresh cell. Between the
    points nothing is known; at the last one the test ended.
    """

    points: tuple[tuple[float, float, float], ...]
    knee_cycle: float | None


AGEING_LAWS = {
    # Figures 4.10, 4.11: the rise ends at 200 cycles, 300: as fresh, 1200: 16 Ah, 1250: 9 Ah;
    # 2.0 mΩ until 900, 2.2 at 1100, 2.6 at 1200, 8 at 1250. 900 and 1100 in between: ASSUME.
    ("C", "standard"): AgeingLaw(
        (
            (0, 1.0, 1.0), (200, 1.005, 1.001), (300, 1.0, 1.002), (900, 0.900, 1.01),
            (1100, 0.848, 1.1), (1200, 16 / 19.56, 1.3), (1250, 9 / 19.56, 4.0),
        ),
        1200,
    ),
    # Figures 4.8, 4.9: 19.56, 19.66, 18.55 Ah at 0, 200, 1300; resistance "similar".
    ("C", "high_power"): AgeingLaw(
        ((0, 1.0, 1.0), (200, 19.66 / 19.56, 1.001), (1300, 18.55 / 19.56, 1.05)), None
    ),
    # Figure 4.12: the pattern of the standard test, the drop around 300, 330 and 370 cycles in all.
    ("C", "fast_charge"): AgeingLaw(
        (
            (0, 1.0, 1.0), (50, 1.003, 1.001), (80, 1.0, 1.002), (225, 0.915, 1.02),
            (275, 0.860, 1.1), (300, 0.830, 1.3), (350, 0.50, 4.0),
        ),
        300,
    ),
    # Figures 4.14, 4.15: 95, 92, 83 % at 300, 500, 900; drop at 850; 1200 in all. The resistance
    # is not told: ASSUME, here and below.
    ("B", "standard"): AgeingLaw(
        (
            (0, 1.0, 1.0), (300, 0.95, 1.02), (500, 0.92, 1.05), (850, 0.860, 1.12),
            (900, 0.83, 1.16), (1200, 0.62, 1.6),
        ),
        850,
    ),
    # 650 cycles of a steady decline whose size is not told.
    ("A", "standard"): AgeingLaw(((0, 1.0, 1.0), (300, 0.93, 1.03), (650, 0.85, 1.10)), None),
    # Used cells: 80 % within 150 (D) and 200 cycles (E); high power of E drops after 100.
    ("D", "standard"): AgeingLaw(((0, 1.0, 1.0), (75, 0.91, 1.05), (150, 0.80, 1.2)), None),
    ("E", "standard"): AgeingLaw(
        ((0, 1.0, 1.0), (100, 0.905, 1.05), (200, 0.80, 1.15), (400, 0.60, 1.6)), None
    ),
    ("E", "high_power"): AgeingLaw(
        ((0, 1.0, 1.0), (50, 0.96, 1.03), (100, 0.91, 1.1), (150, 0.70, 1.6)), 100
    ),
}  # fmt: skip
# Not tested in the thesis. ASSUME: fast charge wears a cell out in a quarter of the cycles, as it
# did C (300 of 1200), and high power in as many as the standard test.
PACE_OF_PROTOCOL = {"standard": 1.0, "high_power": 1.0, "fast_charge": 0.25}


def ageing_state(kind: str, protocol: str, cycle: float) -> AgeingState:
    """State of a cell of a type (A to E) after a number of equivalent full cycles of a protocol."""
    share = capacity_share(kind, protocol, cycle)
    cell_type = CELL_TYPES[kind]
    lost = max(0.0, 1 - share - cell_type.lam_after)
    lams = {
        "lam_negative": cell_type.lam_negative_per_loss * lost,
        "lam_positive": cell_type.lam_positive_per_loss * lost,
    }
    factor = _law_value(kind, protocol, cycle, column=2)
    # ASSUME: charge transfer slows with the root of the ohmic growth.
    limits = {"between": (-0.02, 0.7), "xtol": 1e-10}
    lli, miss = _lithium_loss(cell_type.chemistry, cell_type.rating, share, **limits, **lams)
    if abs(miss) > 1e-6:
        raise ValueError(f"the material lost alone leaves less than {share:.3f} of the capacity")
    return AgeingState(lli, **lams, resistance_factor=factor, kinetics=factor**-0.5)


def capacity_share(kind: str, protocol: str, cycle: float) -> float:
    """Capacity [1] over that of the fresh cell after a number of cycles."""
    return _law_value(kind, protocol, cycle, column=1)


def knee_cycle(kind: str, protocol: str) -> float | None:
    """Cycle after which capacity falls steeply; None where it does not."""
    return ageing_law(kind, protocol).knee_cycle


def last_cycle(kind: str, protocol: str) -> float:
    """Cycle at which the test ended; there is no state beyond."""
    return ageing_law(kind, protocol).points[-1][0]


def ageing_law(kind: str, protocol: str) -> AgeingLaw:
    """The thesis' ageing of a type and protocol; else its standard law at the protocol's pace."""
    if (kind, protocol) in AGEING_LAWS:
        return AGEING_LAWS[kind, protocol]
    pace, standard = PACE_OF_PROTOCOL[protocol], AGEING_LAWS[kind, "standard"]
    points = tuple((pace * cycle, *rest) for cycle, *rest in standard.points)
    return AgeingLaw(points, None if standard.knee_cycle is None else pace * standard.knee_cycle)


def _law_value(kind, protocol, cycle, *, column) -> float:
    last = last_cycle(kind, protocol)
    if not 0 <= cycle <= last:
        raise ValueError(f"{kind} under {protocol} lived 0 to {last:g} cycles, asked: {cycle:g}")
    return float(_law_curve(kind, protocol, column)(cycle))


@cache
def _law_curve(kind, protocol, column):
    points = np.array(ageing_law(kind, protocol).points)
    return PchipInterpolator(points[:, 0], points[:, column])


def _lithium_loss(chemistry, rating, share, *, between, xtol, **lams):
    """Lithium lost [1] at which a share [1] of the fresh capacity remains, and its error."""
    fresh = electrodes.window(chemistry, rating).capacity_ampere_hour

    def excess(lli):
        try:
            aged = electrodes.window(chemistry, rating, lli=lli, **lams)
        except ValueError:  # more lithium than the remaining graphite takes, or hardly any
            return 1.0 if lli < 0.1 else -1.0
        return aged.capacity_ampere_hour / fresh - share

    lli = float(brentq(excess, *between, xtol=xtol))
    return lli, excess(lli)


SOC = np.linspace(0.0, 1.0, 2001)
FACTOR_SOC = np.linspace(0.0, 1.0, 401)
JOULE_PER_KELVIN_AND_AMPERE_HOUR = 25.0  # about 1 kJ/(kg K) and 40 Ah/kg
KELVIN_AMPERE_HOUR_PER_WATT = 40.0  # a chamber's fan: 1.3 K/W at 30 Ah
# Share of the ohmic resistance, time constant [s], how much more of it there is near empty [1]:
# charge transfer, then diffusion, ever slower. So chosen that pulses and rests run as those of real
# cells do (lab/README.md): with fewer pairs a rest would end too soon.
PAIRS = (
    (0.15, 0.7, 1.5), (0.20, 5.0, 1.5), (0.25, 40.0, 2.5), (0.20, 400.0, 2.5), (0.25, 2500.0, 2.5),
)  # fmt: skip
HALF_RATE_SHARE = 0.985  # of the charge between the cut-offs at rest, what a C/2 discharge gives
TRANSFER_PAIRS = 1  # of these, the first


class Circuit(NamedTuple):
    """Temperature dependence of a type's resistances, and its hysteresis.

    Activation energies [J/mol] of the ohmic part, of charge transfer and of diffusion; half of the
    gap between charge and discharge at rest [V]; loss of capacity in the cold [1/K].
    """

    ohmic: float
    transfer: float
    diffusion: float
    hysteresis_volt: float = 0.0
    capacity_per_kelvin: float = 0.0


# E: Rs and Rct of table 3.1 (9 and 70 kJ/mol) and what a C/30 charge loses down to −20 °C (S9).
# C: 1 % of capacity for 4 °C (S4). ASSUME the others, alike.
CIRCUITS = {
    "A": Circuit(15e3, 55e3, 35e3, hysteresis_volt=0.012),
    "B": Circuit(15e3, 55e3, 35e3, hysteresis_volt=0.012),
    "C": Circuit(12e3, 55e3, 35e3, capacity_per_kelvin=2.5e-3),
    "D": Circuit(12e3, 55e3, 35e3, capacity_per_kelvin=1e-3),
    "E": Circuit(9e3, 70e3, 35e3, capacity_per_kelvin=1e-3),
}


def cell(kind: str, *, resistance: float = 1.0, size: float = 1.0, **losses: float) -> fast.Cell:
    """A cell of a type, fresh or aged.

    Parameters
    ----------
    kind : a name of CIRCUITS.
    resistance : factor on all resistances [1].
    size : factor on what the electrodes hold [1]: cells of a type are not quite alike.
    losses : `lli`, `lam_negative`, `lam_positive` [1], see `electrodes.window`.

    Returns
    -------
    fast.Cell, whose state of charge is that of the window between the cut-offs at rest.
    """
    cell_type, circuit = CELL_TYPES[kind], CIRCUITS[kind]
    window = electrodes.window(cell_type.chemistry, _sized_rating(cell_type), **losses)
    r0 = resistance * cell_type.fresh_ohm
    per_ampere_hour = 1 / cell_type.rating.capacity_ampere_hour
    slower = len(PAIRS) - TRANSFER_PAIRS
    energies = (circuit.transfer,) * TRANSFER_PAIRS + (circuit.diffusion,) * slower
    return fast.Cell(
        rating=cell_type.rating,
        ocv_volt=electrodes.open_circuit_volt(cell_type.chemistry, window, SOC),
        capacity_ampere_hour=size * window.capacity_ampere_hour,
        capacity_per_kelvin=circuit.capacity_per_kelvin,
        entropic_volt_per_kelvin=electrodes.entropic_volt_per_kelvin(
            cell_type.chemistry, window, FACTOR_SOC
        ),
        r0_ohm=r0,
        r0_factor=towards_the_ends(low=0.35, high=0.10),
        r0_activation_joule_per_mole=circuit.ohmic,
        pair_r_ohm=tuple(share * r0 for share, _, _ in PAIRS),
        pair_tau_second=tuple(second for _, second, _ in PAIRS),
        pair_factor=tuple(towards_the_ends(low=low, high=0.3) for _, _, low in PAIRS),
        pair_activation_joule_per_mole=energies,
        pair_tau_activation_joule_per_mole=tuple(0.4 * energy for energy in energies),
        hysteresis_volt=circuit.hysteresis_volt,
        hysteresis_per_soc=25.0 if circuit.hysteresis_volt else 0.0,
        heat_capacity_joule_per_kelvin=JOULE_PER_KELVIN_AND_AMPERE_HOUR / per_ampere_hour,
        core_resistance_kelvin_per_watt=0.3 * KELVIN_AMPERE_HOUR_PER_WATT * per_ampere_hour,
        surface_resistance_kelvin_per_watt=KELVIN_AMPERE_HOUR_PER_WATT * per_ampere_hour,
    )


def aged(kind: str, protocol: str, cycle: float) -> fast.Cell:
    """A cell of a type after so many cycles of an ageing protocol."""
    state = ageing_state(kind, protocol, cycle)
    return cell(kind, resistance=state.resistance_factor, **losses_of(state))


def losses_of(state: AgeingState) -> dict[str, float]:
    """Losses [1] of a state, as arguments of `electrodes.window` and `cell`."""
    return {name: getattr(state, name) for name in ("lli", "lam_negative", "lam_positive")}


def worn(kind: str, measured_ampere_hour: float, *, lam_positive: float) -> dict[str, float]:
    """Losses and size of a cell with a given capacity [Ah] at C/2, for `cell`.

    The loss of positive material is given [1], the negative one loses half as much; the rest of
    the capacity loss is lithium. A cell with more capacity than its type when fresh is a larger
    one.
    """
    cell_type = CELL_TYPES[kind]
    share = measured_ampere_hour / cell_type.fresh_ampere_hour
    if share >= 1:
        return {"size": share}
    lams = {"lam_positive": lam_positive, "lam_negative": 0.5 * lam_positive}
    limits = {"between": (0.0, 0.6), "xtol": 1e-9}
    rating = _sized_rating(cell_type)
    lli, _ = _lithium_loss(cell_type.chemistry, rating, share, **limits, **lams)
    return {"lli": lli, **lams}


def _sized_rating(cell_type):
    """Rating of a cell whose electrodes have the capacity at C/2 that the thesis measured fresh."""
    rest = cell_type.fresh_ampere_hour / HALF_RATE_SHARE
    rated = rest / electrodes.CHEMISTRIES[cell_type.chemistry].rest_per_rated
    return cell_type.rating._replace(capacity_ampere_hour=rated)


def towards_the_ends(*, low: float, high: float) -> np.ndarray:
    """Factor [1] of a resistance over SoC: flat, but rising at both ends (thesis figure 3.11)."""
    return 1 + low * np.exp(-FACTOR_SOC / 0.06) + high * np.exp(-(1 - FACTOR_SOC) / 0.04)


TABLE_FREQUENCY_HERTZ = np.logspace(3, -2, 51)
TEMPERATURES_CELSIUS = (20.0, 10.0, 5.0, 0.0, -10.0)
SOCS = (0.05, 0.5, 1.0)
REPEATS = 3


class TabulatedCircuit(NamedTuple):
    """Parameters of the circuit by the names of the results contract.

    Resistances [ohm]; `cpe_t` [S·s^P] and `cpe_p` [1] of the constant-phase element; `warburg_y0`
    [S·s^½].
    """

    r_ohmic_ohm: float
    r_charge_transfer_ohm: float
    cpe_t: float
    cpe_p: float
    warburg_y0: float


# Rows in the order of the fields, columns in that of TEMPERATURES_CELSIUS.
TABLE = {
    0.05: (
        (1.67e-3, 1.83e-3, 1.99e-3, 2.19e-3, 2.75e-3),
        (9.33e-4, 2.22e-3, 3.91e-3, 6.64e-3, 2.46e-2),
        (20.0, 18.55, 17.8, 16.58, 12.93),
        (0.79, 0.70, 0.65, 0.63, 0.6014),
        (3159.0, 2675.0, 2415.0, 1839.0, 1611.0),
    ),
    0.5: (
        (2.02e-3, 2.23e-3, 2.41e-3, 2.67e-3, 3.05e-3),
        (6.48e-4, 1.63e-3, 2.76e-3, 4.86e-3, 1.74e-2),
        (14.9, 12.22, 11.96, 12.21, 12.22),
        (0.87, 0.77, 0.72, 0.68, 0.64),
        (4777.0, 3721.0, 3315.0, 3042.0, 3013.0),
    ),
    1.0: (
        (1.91e-3, 2.06e-3, 2.19e-3, 2.42e-3, 3.17e-3),
        (6.80e-4, 1.56e-3, 2.60e-3, 4.48e-3, 1.60e-2),
        (18.7, 13.9, 12.8, 12.76, 12.15),
        (0.81, 0.76, 0.72, 0.67, 0.61),
        (2531.0, 1844.0, 1498.0, 1194.0, 813.2),
    ),
}


def conditions() -> list[tuple[float, float]]:
    """The table's fifteen conditions: state of charge [1], temperature [°C]."""
    return [(soc, celsius) for soc in SOCS for celsius in TEMPERATURES_CELSIUS]


def circuit_at(soc: float, celsius: float) -> TabulatedCircuit:
    """Parameters of the circuit at one of the table's conditions; there are none in between."""
    if soc not in TABLE or celsius not in TEMPERATURES_CELSIUS:
        allowed = f"SoC {SOCS} and {TEMPERATURES_CELSIUS} °C"
        raise ValueError(f"table 3.1 knows {allowed}, asked: {soc}, {celsius} °C")
    column = TEMPERATURES_CELSIUS.index(celsius)
    return TabulatedCircuit(*(row[column] for row in TABLE[soc]))


def impedance_ohm(parameters: TabulatedCircuit, frequency_hertz: np.ndarray) -> np.ndarray:
    """Complex impedance [ohm] at each frequency [Hz]; capacitive arcs have a negative part."""
    j_omega = 2j * np.pi * np.asarray(frequency_hertz)
    capacitive = parameters.cpe_t * j_omega**parameters.cpe_p
    faradaic = parameters.r_charge_transfer_ohm + 1 / (parameters.warburg_y0 * np.sqrt(j_omega))
    return parameters.r_ohmic_ohm + 1 / (capacitive + 1 / faradaic)


class Tabulated(NamedTuple):
    """The 32 Ah LMO cell of table 3.1, as a specimen on an impedance analyser."""

    frequency_hertz = TABLE_FREQUENCY_HERTZ

    def spectrum(self, frequency_hertz, *, celsius: float, soc: float):
        """Impedance [ohm] at frequencies [Hz], temperature [°C] and state of charge [1]."""
        return impedance_ohm(circuit_at(soc, celsius), frequency_hertz)

    def circuit(self, *, celsius: float, soc: float) -> dict:
        """Row of the truth table `eis`."""
        return circuit_at(soc, celsius)._asdict()

    def facts(self, name: str) -> dict[str, list[dict]]:
        """No truth is known of the cell beside its spectra."""
        return {}
