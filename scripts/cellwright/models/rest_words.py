"""What stands between a rest and two exponentials, in words."""

import numpy as np

SMALL = 10.0  # noises that a rest must move to show more than one time constant
COARSE = 20.0  # grains that a rest must move
AT_NOISE = 1.2  # residual over noise up to which nothing is left to explain


def grain_volt(voltage_volt):
    """Smallest step that the logger shows (n,) → [V]; 0 where the voltage never moves."""
    moved = np.abs(np.diff(voltage_volt))
    return float(moved[moved > 1e-7].min(initial=np.inf)) if (moved > 1e-7).any() else 0.0


def noise_volt(voltage_volt):
    """Standard deviation of a sample in the second half of a rest (n,) → [V].

    From second differences, so that a slope is none; not below that of the logger's grain.
    """
    late = np.asarray(voltage_volt)[len(voltage_volt) // 2 :]
    bent = np.diff(late, 2)
    spread = 1.4826 * float(np.median(np.abs(bent))) / np.sqrt(6) if len(bent) else 0.0
    return max(spread, grain_volt(voltage_volt) / np.sqrt(12))


def why(two, three, voltage_volt, *, limit, grain, noise):
    """What stands against two exponentials, or holds their R² below the limit.

    Parameters
    ----------
    two, three : relaxation.Relaxation, of at most two and three exponentials.
    voltage_volt : (n,) of the rest [V].
    limit : R² that is asked for.
    grain, noise : of the logger, of a sample [V].

    Returns
    -------
    words : sentences joined by "; ", the most telling first; empty where nothing stands against.
    """
    best = three if len(three.tau_second) == 3 else two
    short = best.r_squared < limit
    said = [
        *_small(voltage_volt, grain, noise, short=short or len(two.tau_second) < 2),
        *_three(two, three),
        *([f"two time constants are not told: {two.verdict}"] if len(two.tau_second) < 2 else []),
        *_short(best, voltage_volt, noise, limit),
    ]
    if len(best.tau_second) > 1 and best.verdict:
        said.append(f"still drifting: {best.verdict}")
    return "; ".join(said)


def _small(voltage, grain, noise, *, short):
    moved = float(np.ptp(voltage))
    if short and moved < COARSE * grain and noise < grain:
        yield f"quantised: {_mv(moved)} in steps of {_mv(grain)}"
    elif short and moved < SMALL * noise:
        yield f"too small for the noise: it moves {_mv(moved)}, the noise is {_mv(noise)}"


def _three(two, three):
    if len(three.tau_second) == 3:
        taus = ", ".join(f"{tau:.3g}" for tau in three.tau_second)
        better = f"R² {three.r_squared:.4f} against {two.r_squared:.4f} of two"
        yield f"three time constants are visible ({taus} s): {better}"


def _short(best, voltage, noise, limit):
    if best.r_squared >= limit:
        return
    if best.rmse_volt <= AT_NOISE * noise:
        ceiling = 1 - noise**2 / max(float(np.var(voltage)), noise**2)
        yield f"the noise of {_mv(noise)} allows no R² above {ceiling:.3f}"
    else:
        found = f"{_mv(best.rmse_volt)} are left where the noise is {_mv(noise)}"
        yield f"more than {len(best.tau_second)} time constants, or a step within: {found}"


def _mv(volt):
    return f"{1e3 * abs(volt):.2g} mV"
