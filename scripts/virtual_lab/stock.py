"""The thesis' five types of cell (tables 4.1 and 4.2) on the shelf, for the fast generator.

What the electrodes hold, and so where plateaus lie and peaks move, comes from `electrodes`; the
types' data sheets and ohmic resistances from `ageing`. The rest of the circuit: see `Circuit`.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from virtual_lab import ageing, electrodes, fast

SOC = np.linspace(0.0, 1.0, 2001)
FACTOR_SOC = np.linspace(0.0, 1.0, 401)
JOULE_PER_KELVIN_AND_AMPERE_HOUR = 25.0  # about 1 kJ/(kg K) and 40 Ah/kg
KELVIN_AMPERE_HOUR_PER_WATT = 40.0  # a chamber's fan: 1.3 K/W at 30 Ah
# Share of the ohmic resistance, time constant [s], how much more of it there is near empty [1]:
# charge transfer, then diffusion, ever slower. So chosen that pulses and rests run as those of real
# cells do (docs/virtual-laboratory.md): with fewer pairs a rest would end too soon.
PAIRS = (
    (0.15, 0.7, 1.5), (0.20, 5.0, 1.5), (0.25, 40.0, 2.5), (0.20, 400.0, 2.5), (0.25, 2500.0, 2.5),
)  # fmt: skip
HALF_RATE_SHARE = 0.985  # of the charge between the cut-offs at rest, what a C/2 discharge gives
TRANSFER_PAIRS = 1  # of these, the first


class Circuit(NamedTuple):
    """How a type's resistances move with temperature, and its hysteresis.

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
    sheet, circuit = ageing.KINDS[kind], CIRCUITS[kind]
    window = electrodes.window(sheet.chemistry, _sized(sheet), **losses)
    r0 = resistance * sheet.fresh_ohm
    per_ampere_hour = 1 / sheet.rating.capacity_ampere_hour
    slower = len(PAIRS) - TRANSFER_PAIRS
    energies = (circuit.transfer,) * TRANSFER_PAIRS + (circuit.diffusion,) * slower
    return fast.Cell(
        rating=sheet.rating,
        ocv_volt=electrodes.open_circuit_volt(sheet.chemistry, window, SOC),
        capacity_ampere_hour=size * window.capacity_ampere_hour,
        capacity_per_kelvin=circuit.capacity_per_kelvin,
        entropic_volt_per_kelvin=electrodes.entropic_volt_per_kelvin(
            sheet.chemistry, window, FACTOR_SOC
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
    state = ageing.state(kind, protocol, cycle)
    return cell(kind, resistance=state.resistance_factor, **losses_of(state))


def losses_of(state: ageing.Ageing) -> dict[str, float]:
    """What a state has lost, as `electrodes.window` takes it."""
    return {name: getattr(state, name) for name in ("lli", "lam_negative", "lam_positive")}


def worn(kind: str, measured_ampere_hour: float, *, lam_positive: float) -> dict[str, float]:
    """Losses and size of a cell that gives a capacity [Ah] at C/2, for `cell`.

    The positive material's loss is given [1], the negative one loses half as much; lithium what is
    missing then. A cell that gives more than its type does when fresh is a larger one.
    """
    sheet = ageing.KINDS[kind]
    share = measured_ampere_hour / sheet.fresh_ampere_hour
    if share >= 1:
        return {"size": share}
    lams = {"lam_positive": lam_positive, "lam_negative": 0.5 * lam_positive}
    rating = _sized(sheet)
    fresh = electrodes.window(sheet.chemistry, rating).capacity_ampere_hour

    def excess(lli):
        try:
            left = electrodes.window(sheet.chemistry, rating, lli=lli, **lams)
        except ValueError:  # more lithium than the rest of the graphite takes, or hardly any left
            return 1.0 if lli < 0.1 else -1.0
        return left.capacity_ampere_hour / fresh - share

    return {"lli": brentq(excess, 0.0, 0.6, xtol=1e-9), **lams}


def _sized(sheet):
    """Data sheet of a cell whose electrodes hold what the thesis' fresh cell has given at C/2."""
    rest = sheet.fresh_ampere_hour / HALF_RATE_SHARE
    made = electrodes.CHEMISTRIES[sheet.chemistry].rest_per_rated
    return sheet.rating._replace(capacity_ampere_hour=rest / made)


def towards_the_ends(*, low: float, high: float) -> np.ndarray:
    """Factor of a resistance over SoC: flat, but for the ends (thesis figure 3.11)."""
    return 1 + low * np.exp(-FACTOR_SOC / 0.06) + high * np.exp(-(1 - FACTOR_SOC) / 0.04)
