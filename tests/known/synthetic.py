"""Records of the true cell with one more effect, ready for an identification."""

import numpy as np
import truth

from cellwright.circuits.circuit import Branch, member_named
from cellwright.identification.identify import data_of, identify
from cellwright.records.record import record_of

NOISE_VOLT = 1e-3
CAPACITY = truth.CAPACITY_AMPERE_HOUR


def measured(seed, *, seconds=8000, shift=0.0, extra=(), resistance_factor=1.0, hold="first_order"):
    """A drive from 95 to about 10 %: time, current, noisy voltage, SoC."""
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng, seconds)
    soc = truth.soc_of(time, current, 0.95)
    clean = truth.voltage(time, current, soc, shift, hold, extra, resistance_factor)
    return time, current, clean + rng.normal(0, NOISE_VOLT, len(time)), soc


def harsh(seed, *, extra=(), resistance_factor=1.0, hold="first_order", seconds=4000):
    """Currents three times as large, as of a cell with as much more capacity."""
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng, seconds)
    current = 3.0 * current
    soc = truth.soc_of(time, current, 0.95)
    soc = 0.1 + 0.8 * (soc - soc.min()) / np.ptp(soc)
    clean = truth.voltage(
        time, current, soc, hold=hold, extra=extra, resistance_factor=resistance_factor
    )
    return time, current, clean + rng.normal(0, NOISE_VOLT, len(time)), soc


def hysteresis(m_volt=0.02, charge_ampere_hour=0.06):
    return Branch("hysteresis", {"m_volt": m_volt, "charge_ampere_hour": charge_ampere_hour})


def transfer(scale_volt, r_ohm=0.04, tau_second=0.5):
    parameters = {"r_ohm": r_ohm, "tau_second": tau_second, "scale_volt": scale_volt}
    return Branch("kinetic", parameters)


def diffusion(tau_second, resistance_factor=1.0):
    gain = resistance_factor * tau_second / 15 / 3600 / CAPACITY
    return Branch("diffusion", {"soc_per_ampere": gain, "tau_second": tau_second})


def data(*measured, resistance_factor=1.0, used=None, **change):
    settings = {"capacity_ampere_hour": CAPACITY, "knots": truth.KNOTS} | change
    record = record_of(*measured, resistance_factor=resistance_factor, used=used)
    return data_of([record], truth.OCV_VOLT, **settings)


def fit(ready, member="2RC", **settings):
    return identify(ready, member_named(member), capacity_ampere_hour=CAPACITY, **settings)


def with_target(system, target):
    """The same columns for another measurement."""
    return system._replace(target=target, moment=system.matrix.T @ target)
