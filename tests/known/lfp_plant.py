"""A cell of lithium iron phosphate with hysteresis by its own few lines, and its usual tests.

It shares no code with the models that are identified from it.
"""

import numpy as np

LOW_VOLT, HIGH_VOLT, CAPACITY_AMPERE_HOUR = 2.5, 3.6, 5.0
R0_OHM, PAIRS = 0.020, ((0.012, 20.0), (0.010, 300.0))
TABLE = np.linspace(-0.05, 1.05, 4401)


def open_circuit_volt(soc):
    """Two plateaus, near 3.29 and 3.33 V, and steep ends."""
    middle = 3.205 + 0.08 / (1 + np.exp(-(soc - 0.15) / 0.035))
    middle += 0.042 / (1 + np.exp(-(soc - 0.68) / 0.02)) + 0.01 * soc
    return middle - 0.70 * np.exp(-soc / 0.02) + 0.25 * np.exp((soc - 1) / 0.012)


class Bench:
    """The cell on a tester that logs time [s], current [A] and voltage [V] of its tests."""

    def __init__(self, m_volt, *, per_soc=40.0, seed=1, noise_volt=2e-4):
        self.m_volt, self.per_soc, self.noise_volt = m_volt, per_soc, noise_volt
        self.rng, self.ocv = np.random.default_rng(seed), open_circuit_volt(TABLE)
        self.soc, self.lags, self.hysteresis, self.second = 1.0, [0.0, 0.0], 0.0, 0.0
        self.rows = []

    def rested_volt(self):
        ocv = np.interp(self.soc, TABLE, self.ocv)
        return ocv + self.m_volt * self.hysteresis + sum(self.lags)

    def step(self, ampere, second, *, volt=None):
        for k, (ohm, tau) in enumerate(PAIRS):
            keep = np.exp(-second / tau)
            self.lags[k] = keep * self.lags[k] + (1 - keep) * ohm * ampere
        moved = ampere * second / 3600 / CAPACITY_AMPERE_HOUR
        self.soc += moved
        if ampere:
            keep = np.exp(-self.per_soc * abs(moved))
            self.hysteresis = keep * self.hysteresis + (1 - keep) * np.sign(ampere)
        self.second += second
        volt = self.rested_volt() + R0_OHM * ampere if volt is None else volt
        noise = self.noise_volt * self.rng.normal()
        self.rows.append((self.second, round(ampere, 5), round(volt + noise, 5)))
        return volt

    def hold(self, ampere, second, each=1.0):
        """A current for a time, or until it reaches a cut-off; whether it lasted."""
        for _ in range(round(second / each)):
            volt = self.step(ampere, each)
            if (ampere < 0 and volt <= LOW_VOLT) or (ampere > 0 and volt >= HIGH_VOLT):
                return False
        return True

    def fill(self, ampere, end_ampere, each):
        self.hold(ampere, 3e5, each)
        while ampere > end_ampere:
            ampere = (HIGH_VOLT - self.rested_volt()) / R0_OHM
            self.step(ampere, each, volt=HIGH_VOLT)

    def series(self):
        names = ("test_time_second", "current_ampere", "voltage_volt")
        return dict(zip(names, np.transpose(self.rows), strict=True))


def capacity(bench, ampere=2.5, each=10.0):
    bench.hold(0.0, 600, 60.0)
    bench.hold(-ampere, 9e4, each)
    bench.hold(0.0, 1800, 60.0)
    bench.fill(ampere, ampere / 25, each)
    bench.hold(0.0, 1800, 60.0)
    return bench.series()


def slow(bench):
    return capacity(bench, 0.25, 60.0)


def pulses(bench, steps=19, share=0.05, rest_second=900.0):
    bench.hold(0.0, 600, 10.0)
    for _ in range(steps):
        bench.hold(-2.5, share * CAPACITY_AMPERE_HOUR / 2.5 * 3600, 10.0)
        bench.hold(0.0, rest_second, 10.0)
        bench.hold(-5.0, 10, 0.1)
        bench.hold(0.0, 40, 0.1)
        bench.hold(5.0, 10, 0.1)
        bench.hold(0.0, 5, 0.1)
        bench.hold(0.0, 300, 10.0)
    return bench.series()


def drive(bench, hours=2.0):
    bench.hold(0.0, 600, 10.0)
    while bench.second < 600 + 3600 * hours:
        ampere = np.clip(bench.rng.normal(-1.5, 3.0), -10.0, 0.0 if bench.soc > 0.98 else 5.0)
        if not bench.hold(round(float(ampere), 3), int(bench.rng.integers(5, 40))):
            break
    bench.hold(0.0, 900, 10.0)
    return bench.series()
