"""Adaptive extended Kalman filter (thesis, table 2.3) for the SoC, from a wrong start."""

import cell
import numpy as np
from timing import Entry, Goal, Topic, where_importable

SAMPLES, WINDOW = 20000, 60
SENSOR_VOLT, START = 2e-3, 0.5


def adaptive():
    """Topic: a drive, 1 s apart, two RC pairs, from an SoC 30 % too low."""
    record = _record()
    makers = {
        "**Cellwright**": lambda: _ours(*record),
        "its recursion alone": lambda: _recursion(*record),
        "with its default states": lambda: _default(*record),
        "its numpy form": lambda: _twin(*record),
        "filterpy": lambda: _filterpy(*record),
    }
    needed = {
        "**Cellwright**": ("cellwright.filters.estimate",),
        "its recursion alone": ("cellwright.filters.estimate",),
        "with its default states": ("cellwright.filters.estimate",),
        "its numpy form": ("cellwright.filters.estimate",),
        "filterpy": ("filterpy.kalman",),
    }
    entries, skipped = where_importable(needed, makers)
    return Topic(
        "Adaptive extended Kalman filter",
        f"{SAMPLES:,} samples of a drive, two RC pairs with parameters over SoC, "
        f"{1e3 * SENSOR_VOLT:g} mV of noise, from an SoC 0.3 too low. Three states (SoC and two "
        "lags), as filterpy's; by default ours has four more: three errors of the model and a "
        "scale of the ohmic resistance. The recursion alone is without the first sample, which is "
        "weighed over all SoC, and without what is laid out before",
        "RMS error of the SoC after 600 s",
        [entry._replace(accuracy=_judge(record[-1])) for entry in entries],
        skipped,
        SAMPLES,
        "step",
        (Goal("its recursion alone", 3e-8),),
    )


def _record():
    time, current = np.arange(float(SAMPLES)), cell.drive(SAMPLES, seed=4)
    volt, soc = cell.simulated(time, current, 0.8)
    noise = SENSOR_VOLT * np.random.default_rng(6).normal(size=SAMPLES)
    return time, current, volt + noise, soc


def _judge(true):
    def judge(found):
        soc = getattr(found, "soc", found)
        return f"{100 * np.sqrt(np.mean((soc - true)[600:] ** 2)):.2f} %"

    return judge


def _estimate(time, current, volt, **settings):
    from cellwright.filters.bank import bank_of
    from cellwright.filters.estimate import Start, estimate

    bank = bank_of(cell.model(), "2RC", 25.0)
    return lambda: estimate(bank, time, current, volt, Start(START), method="aekf", **settings)


def _three_states():
    """No state but SoC and lags: sensor and model err by white noise."""
    from cellwright.filters.plant import Noise

    spans = dict.fromkeys(("error_second", "fast_second", "error_soc", "skew_second"), 0.0)
    return {"noise": Noise(window=WINDOW, **spans), "track_ohmic": False}


def _ours(time, current, volt, _soc):
    return Entry("**Cellwright**", _estimate(time, current, volt, **_three_states()), None, runs=11)


def _recursion(time, current, volt, _soc):
    from cellwright.filters.bank import bank_of
    from cellwright.filters.estimate import Start
    from cellwright.filters.kalman import acquire, run
    from cellwright.filters.plant import plant_of

    noise = _three_states()["noise"]
    bank = bank_of(cell.model(), "2RC", 25.0)
    plant = plant_of(bank, time, current, volt, noise, hold="first_order")
    state = acquire(plant, Start(START), noise)[0]
    return Entry("its recursion alone", lambda: run(plant, noise, state)[:, 0], None, runs=11)


def _default(time, current, volt, _soc):
    return Entry("with its default states", _estimate(time, current, volt), None, runs=11)


def _twin(time, current, volt, _soc):
    """The same without compiled kernels."""
    from cellwright.filters import kalman

    run = _estimate(time, current, volt, **_three_states())

    def plain():
        kept, kalman.function = kalman.function, lambda *_types: None
        try:
            return run()
        finally:
            kalman.function = kept

    return Entry("its numpy form", plain, None)


def _filterpy(_time, current, volt, _soc):
    from filterpy.kalman import ExtendedKalmanFilter

    decay = np.exp(-1.0 / cell.TAU)
    rise = np.gradient(cell.OCV, cell.GRID)

    def at(curve, soc):
        return np.interp(soc, cell.GRID, curve)

    def jacobian(x):
        return np.array([[at(rise, x[0]), 1.0, 1.0]])

    def expected(x, ampere):
        return np.array([at(cell.OCV, x[0]) + at(cell.R0, x[0]) * ampere + x[1] + x[2]])

    def run():
        ekf = ExtendedKalmanFilter(dim_x=3, dim_z=1)
        ekf.x = np.array([START, 0.0, 0.0])
        ekf.P = np.diag([0.1, 1e-4, 1e-4])
        ekf.Q, ekf.R = np.diag([1e-8, 1e-10, 1e-10]), np.array([[SENSOR_VOLT**2]])
        ekf.F = np.diag([1.0, *decay])
        innovations, found, before = [], [], 0.0
        for ampere, shown in zip(current, volt, strict=True):
            r = np.array([at(one, ekf.x[0]) for one in cell.R])
            charge = before / (3600.0 * cell.CAPACITY_AMPERE_HOUR)
            ekf.x = ekf.F @ ekf.x + np.append(charge, (1 - decay) * r * before)
            ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
            innovation = shown - expected(ekf.x, ampere)[0]
            innovations = [*innovations[1 - WINDOW :], innovation**2]
            own = (jacobian(ekf.x) @ ekf.P @ jacobian(ekf.x).T)[0, 0]
            ekf.R = np.array([[max(np.mean(innovations) - own, SENSOR_VOLT**2)]])
            ekf.update(np.array([shown]), jacobian, expected, hx_args=(ampere,))
            found.append(ekf.x[0])
            before = ampere
        return np.array(found)

    return Entry("filterpy ExtendedKalmanFilter, adaptive", run, None)
