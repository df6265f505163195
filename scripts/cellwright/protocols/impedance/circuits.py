"""Impedance of the thesis' equivalent circuit."""

import numpy as np

NAMES = (
    "r_ohmic_ohm",
    "r_charge_transfer_ohm",
    "cpe_t",
    "cpe_p",
    "warburg_y0",
    "inductance_henry",
)


def circuit_impedance(
    frequency_hertz,
    r_ohmic_ohm,
    r_charge_transfer_ohm,
    cpe_t,
    cpe_p,
    warburg_y0,
    *inductance_henry,
):
    """Resistance in series with a CPE that lies parallel to charge transfer and diffusion.

    Parameters
    ----------
    frequency_hertz : (n,) [Hz].
    r_ohmic_ohm, r_charge_transfer_ohm : resistances [Ω].
    cpe_t, cpe_p : constant-phase element 1/(T (jω)^P) [s^P/Ω], [1].
    warburg_y0 : semi-infinite diffusion 1/(Y0 √(jω)) [s^½/Ω].
    *inductance_henry : of the leads, in series [H]; none given: none there.

    Returns
    -------
    impedance : (n,) complex [Ω]; a capacitive arc has a negative imaginary part.

    Source: thesis sec. 3.2; ω = 2πf.
    """
    rate = 2j * np.pi * np.asarray(frequency_hertz, float)
    faradaic = r_charge_transfer_ohm + 1 / (warburg_y0 * np.sqrt(rate))
    arc = 1 / (cpe_t * rate**cpe_p + 1 / faradaic)
    return r_ohmic_ohm + arc + rate * sum(inductance_henry)
