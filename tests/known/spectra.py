"""Spectra with known truth, by a formula of the tests' own; measured ones read by hand."""

import gzip
from types import SimpleNamespace

import numpy as np

from cellwright.protocols.impedance.analysis import impedance
from cellwright.protocols.impedance.circuits import THESIS as THESIS_CIRCUIT

FREQUENCY = np.geomspace(1e-2, 1e3, 61)
NAMES = ("r_ohmic_ohm", "r_charge_transfer_ohm", "cpe_t", "cpe_p", "warburg_y0")
NOISE = 0.003
# Thesis table 3.1, columns 20, 10, 5, 0, −10 °C (errata: signs of the header turned). Rs at 5 % and
# −10 °C is lost in print; 2.75 mΩ goes on along its column.
TABLE = {
    0.05: [
        (1.67e-3, 9.33e-4, 20, 0.79, 3159),
        (1.83e-3, 2.22e-3, 18.55, 0.70, 2675),
        (1.99e-3, 3.91e-3, 17.8, 0.65, 2415),
        (2.19e-3, 6.64e-3, 16.58, 0.63, 1839),
        (2.75e-3, 2.46e-2, 12.93, 0.6014, 1611),
    ],
    0.5: [
        (2.02e-3, 6.48e-4, 14.9, 0.87, 4777),
        (2.23e-3, 1.63e-3, 12.22, 0.77, 3721),
        (2.41e-3, 2.76e-3, 11.96, 0.72, 3315),
        (2.67e-3, 4.86e-3, 12.21, 0.68, 3042),
        (3.05e-3, 1.74e-2, 12.22, 0.64, 3013),
    ],
    1.0: [
        (1.91e-3, 6.80e-4, 18.7, 0.81, 2531),
        (2.06e-3, 1.56e-3, 13.9, 0.76, 1844),
        (2.19e-3, 2.60e-3, 12.8, 0.72, 1498),
        (2.42e-3, 4.48e-3, 12.76, 0.67, 1194),
        (3.17e-3, 1.60e-2, 12.15, 0.61, 813.2),
    ],
}
CONDITIONS = [row for rows in TABLE.values() for row in rows]
THESIS = TABLE[0.5][3]


def thesis_impedance(parameters, frequency=FREQUENCY, *, henry=0.0):
    """Rs + jωL + 1/(T(jω)^P + 1/(Rct + 1/(Y0√(jω)))), as printed in 3.2."""
    rs, rct, t, p, y0 = parameters
    s = 2j * np.pi * frequency
    return rs + s * henry + 1 / (t * s**p + 1 / (rct + 1 / (y0 * s**0.5)))


def noisy(clean, *, seed=0, relative=NOISE):
    """A spectrum with noise in proportion to the modulus on both parts."""
    noise = np.random.default_rng(seed).standard_normal((2, len(clean)))
    return clean + relative * np.abs(clean) * (noise[0] + 1j * noise[1])


def measured(path):
    """Frequency and impedance in a Digatron file, without the house's reader."""
    with gzip.open(path, "rt", errors="replace") as file:
        lines = file.read().splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("Time Stamp"))
    places = [lines[start].split(";").index(name) for name in ("ActFreq", "Zreal1", "Zimg1")]
    rows = [line.split(";") for line in lines[start + 2 :] if line.count(";") > max(places)]
    frequency, real, imaginary = np.array([[float(row[k]) for k in places] for row in rows]).T
    return frequency, (real + 1j * imaginary) / 1000


def columns_of(frequency, ohm, **others):
    """A spectrum as its file would hold it."""
    parts = {"impedance_real_ohm": np.real(ohm), "impedance_imaginary_ohm": np.imag(ohm)}
    return {"frequency_hertz": frequency} | parts | others


def analyse(frequency, ohm, *, celsius=None, **settings):
    """What `impedance` says of a spectrum by one circuit, with its row beside the tables."""
    warmth = {} if celsius is None else {"surface_temperature_celsius": celsius}
    settings = {"circuit": THESIS_CIRCUIT, "candidates": ()} | settings
    found = impedance(columns_of(frequency, ohm, **warmth), **settings)
    return SimpleNamespace(**found.tables, notes=found.notes, row=found.rows[0])
