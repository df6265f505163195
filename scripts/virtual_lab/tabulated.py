"""Impedance spectra of the circuit in the thesis' table 3.1 (32 Ah LMO cell).

Z = Rs + Z_CPE ‖ (Rct + Z_W) with Z_CPE = 1/(T·(j2πf)^P) and Z_W = 1/(Y0·√(j2πf)), equations of
section 3.2. The header is read as 20, 10, 5, 0, −10 °C: the signs are printed wrongly, since only
so ln Rct is a line over 1/T and resistance grows in the cold. Rs at 5 % and −10 °C is unreadable
in print: ASSUME 2.75 mΩ, on the parabola in °C through the other four of its column (the same
extrapolation misses the printed values of the other two columns by 10 and 5 %).
"""

from typing import NamedTuple

import numpy as np

FREQUENCY_HERTZ = np.logspace(3, -2, 51)
TEMPERATURES_CELSIUS = (20.0, 10.0, 5.0, 0.0, -10.0)
SOCS = (0.05, 0.5, 1.0)
REPEATS = 3


class TabulatedCircuit(NamedTuple):
    """Parameters by the names of the results contract.

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
    """The fifteen conditions: state of charge [1], temperature [°C]."""
    return [(soc, celsius) for soc in SOCS for celsius in TEMPERATURES_CELSIUS]


def circuit_at(soc: float, celsius: float) -> TabulatedCircuit:
    """Parameters at one of the conditions; there are none in between."""
    if soc not in TABLE or celsius not in TEMPERATURES_CELSIUS:
        known = f"SoC {SOCS} and {TEMPERATURES_CELSIUS} °C"
        raise ValueError(f"table 3.1 knows {known}, asked: {soc}, {celsius} °C")
    column = TEMPERATURES_CELSIUS.index(celsius)
    return TabulatedCircuit(*(row[column] for row in TABLE[soc]))


def impedance_ohm(parameters: TabulatedCircuit, frequency_hertz: np.ndarray) -> np.ndarray:
    """Complex impedance [ohm] at each frequency [Hz]; capacitive arcs have a negative part."""
    turning = 2j * np.pi * np.asarray(frequency_hertz)
    capacitive = parameters.cpe_t * turning**parameters.cpe_p
    faradaic = parameters.r_charge_transfer_ohm + 1 / (parameters.warburg_y0 * np.sqrt(turning))
    return parameters.r_ohmic_ohm + 1 / (capacitive + 1 / faradaic)


class Tabulated(NamedTuple):
    """The cell of the table, as a specimen on the analyser."""

    frequency_hertz = FREQUENCY_HERTZ

    def spectrum(self, frequency_hertz, *, celsius: float, soc: float):
        """Impedance [ohm] at frequencies [Hz], temperature [°C] and state of charge [1]."""
        return impedance_ohm(circuit_at(soc, celsius), frequency_hertz)

    def circuit(self, *, celsius: float, soc: float) -> dict:
        """Row of the truth table `eis`."""
        return circuit_at(soc, celsius)._asdict()

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Nothing is known of the cell beside its spectra."""
        return {}
