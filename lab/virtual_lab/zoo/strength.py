"""What of an effect a plain circuit leaves after it was refitted, and which names explain it.

The circuit is an ohmic resistance and two RC pairs on the cell's OCV as its slow test shows it,
with a start per record. Records are free of noise; drives and the pulse test are compared.
"""

from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg.lapack import dtbtrs
from scipy.optimize import minimize

from virtual_lab.zoo import half_cells
from virtual_lab.zoo.cell import Specimen

TAUS = np.geomspace(1.5, 1000.0, 20)
EVERY = 3  # row of the records that is compared
START_SOC, NOISE_VOLT = 0.02, 1.5e-3
FIRST_TAU = (9.0, 110.0)
FIT_FACTOR, VALIDATION_FACTOR = 1.15, 1.3
SAME_DATA = 0.03


class Record(NamedTuple):
    """One noise-free record: columns of `metering.shown`, its chamber [°C], whether it judges."""

    columns: dict
    celsius: float
    judges: bool


class Left(NamedTuple):
    """What a refitted plain circuit leaves [V]: root mean squares, and per row for names.

    `rows`: residuals of fitted and judging rows; `tangent`: columns by which the circuit can still
    move; `signs`: signatures of names, name → list of column groups.
    """

    fit_volt: float
    validation_volt: float
    rows: np.ndarray
    tangent: np.ndarray
    signatures: dict


def lagged(second, drive, tau) -> np.ndarray:
    """Response of a first-order lag [s] at zero before the first instant; straight in between."""
    ratio = np.maximum(np.diff(second) / tau, 1e-9)
    gain = -np.expm1(-ratio)
    after = 1.0 - gain / ratio
    right = np.concatenate([[0.0], (gain - after) * drive[:-1] + after * drive[1:]])
    band = np.ones((2, second.size))
    band[1, :-1] = gain - 1.0
    return dtbtrs(band, right[:, None], uplo="L", overwrite_b=True)[0][:, 0]


@cache
def _bank() -> CubicSpline:
    """Weights of the lags of TAUS that stand for a lag in between, over the logarithm of its τ."""
    return CubicSpline(np.log(TAUS), np.eye(TAUS.size))


class _Table(NamedTuple):
    """Columns of one record on the rows compared; `volt`: what the OCV lacks; `slope`: of it."""

    ampere: np.ndarray
    lags: np.ndarray
    slope: np.ndarray
    volt: np.ndarray
    judges: bool
    soc: np.ndarray
    full: dict


def _table(record: Record, known: Specimen, start_soc: float) -> _Table:
    """What the circuit is fitted to; SoC by the shown current and the capacity that is known."""
    columns, cell = record.columns, known.earlier or known.cell
    second, ampere = columns["time_second"], columns["current_ampere"]
    steps = 0.5 * (ampere[1:] + ampere[:-1]) * np.diff(second) / 3600.0
    soc = start_soc + np.append(0.0, np.cumsum(steps)) / cell.ampere_hour
    ocv = cell.ocv + known.slow_volt
    volt = columns["voltage_volt"] - np.interp(soc, half_cells.SOC, ocv)
    slope = np.interp(soc, half_cells.SOC, np.gradient(ocv, half_cells.SOC))
    kept = slice(None, None, EVERY)
    full = {"second": second, "ampere": ampere, "soc": soc, "volt": columns["voltage_volt"]}
    full |= {"slope": slope, "celsius": np.full(second.size, record.celsius)}
    return _Table(
        *(
            ampere[kept],
            _lags(second.tobytes(), ampere.tobytes()),
            slope[kept],
            volt[kept],
            record.judges,
            soc[kept],
            full,
        )
    )


@lru_cache(maxsize=1000)
def _lags(second, ampere) -> np.ndarray:
    """Lags of TAUS on the rows compared; most effects leave the current of a record as it is."""
    second, ampere = np.frombuffer(second), np.frombuffer(ampere)
    return np.column_stack([lagged(second, ampere, tau)[::EVERY] for tau in TAUS])


def left(records: list[Record], known: Specimen, starts: list[float], *, names=False) -> Left:
    """What a plain circuit leaves of the records of one cell.

    Parameters
    ----------
    records : noise-free. known : the cell as its capacity and slow test tell it. starts : SoC at
        the start of each record as the sheet has it [1]. names : whether signatures are wanted.
    """
    tables = [_table(*pair) for pair in zip(records, [known] * len(records), starts, strict=True)]
    fitted = [table for table in tables if not table.judges]
    gram, count = _gram(fitted)
    best = minimize(
        lambda log_tau: _missed(gram, log_tau, len(fitted)),
        np.log(FIRST_TAU),
        method="Nelder-Mead",
        options={"xatol": 0.02, "fatol": 1e-9 * count, "maxiter": 60},
    )
    tau = np.clip(best.x, np.log(TAUS[0]), np.log(TAUS[-1]))
    values = _solved(gram, tau, len(fitted))[0][:3]
    parts = [_residual(table, values, tau) for table in tables]
    fit = np.concatenate([p for p, t in zip(parts, tables, strict=True) if not t.judges])
    judging = np.concatenate([p for p, t in zip(parts, tables, strict=True) if t.judges])
    tangent = _tangent(tables, values, tau) if names else np.empty(0)
    signatures = _signatures(tables, values, np.exp(tau)) if names else {}
    return Left(_rms(fit), _rms(judging), np.concatenate(parts), tangent, signatures)


def _gram(tables):
    """Products of all columns with each other: current, lags, starts, voltage."""
    width = 1 + TAUS.size
    total = np.zeros((width + len(tables) + 1,) * 2)
    for k, table in enumerate(tables):
        wide = np.column_stack([table.ampere, table.lags, table.slope, table.volt])
        place = np.array([*range(width), width + k, width + len(tables)])
        total[np.ix_(place, place)] += wide.T @ wide
        total[width + k, width + k] += (NOISE_VOLT / START_SOC) ** 2
    return total, sum(table.volt.size for table in tables)


def _solved(gram, log_tau, files):
    """Resistances and starts of the best circuit with two time constants, and its squared error."""
    width = 1 + TAUS.size
    chosen = np.zeros((gram.shape[0], 3 + files + 1))
    chosen[0, 0] = 1.0
    chosen[1:width, 1:3] = _bank()(np.clip(log_tau, np.log(TAUS[0]), np.log(TAUS[-1]))).T
    chosen[width:, 3:] = np.eye(files + 1)
    small = chosen.T @ gram @ chosen
    values = np.linalg.solve(small[:-1, :-1] + 1e-12 * np.eye(3 + files), small[:-1, -1])
    return values, small[-1, -1] - values @ small[:-1, -1]


def _missed(gram, log_tau, files):
    low, high = np.log(TAUS[0]), np.log(TAUS[-1])
    outside = np.sum(np.clip(low - log_tau, 0, None) + np.clip(log_tau - high, 0, None))
    close = max(0.3 - abs(log_tau[0] - log_tau[1]), 0.0)
    return _solved(gram, log_tau, files)[1] * (1 + 10 * outside + 10 * close)


def _residual(table, values, log_tau):
    """Residual [V] of one record, its start free."""
    lags = table.lags @ _bank()(log_tau).T
    volt = table.volt - values[0] * table.ampere - lags @ values[1:]
    return volt - table.slope * _start(table, volt)


def _start(table, volt):
    prior = (NOISE_VOLT / START_SOC) ** 2
    return (table.slope @ volt) / (table.slope @ table.slope + prior)


def _tangent(tables, values, log_tau):
    """Columns by which the circuit can still move, of all rows: elements, and a start a record."""
    columns = [
        np.column_stack(
            [
                table.ampere,
                table.lags @ _bank()(log_tau).T,
                table.lags @ _bank()(log_tau, 1).T,
            ]
        )
        for table in tables
    ]
    rows = [table.volt.size for table in tables]
    starts = np.zeros((sum(rows), len(tables)))
    for k, end in enumerate(np.cumsum(rows)):
        starts[end - rows[k] : end, k] = tables[k].slope
    return np.hstack([np.vstack(columns), starts])


def _signatures(tables, values, taus):
    """By name, groups of columns: by which shape the voltage would change with such an effect."""
    parts = [_shapes(table.full, values, taus) for table in tables]
    kept = slice(None, None, EVERY)
    return {
        name: [
            np.vstack([np.column_stack(part[name][group])[kept] for part in parts])
            for group in range(len(parts[0][name]))
        ]
        for name in parts[0]
    }


def _shapes(full, values, taus):
    """Own simple forms of the effects on one record, to first order: name → groups of columns."""
    second, ampere, soc, slope = (full[k] for k in ("second", "ampere", "soc", "slope"))
    warmer = full["celsius"] - 25.0
    courses = (soc - 0.5, np.exp(-soc / 0.1), np.cos(2 * np.pi * soc))
    pairs = [(r, tau) for r, tau in zip(values[1:], taus, strict=True)]
    elements = [values[0] * ampere, *(r * lagged(second, ampere, tau) for r, tau in pairs)]
    total = sum(elements)
    rise = [lagged(second, ampere**2, tau) for tau in (200.0, 500.0, 1200.0)]
    charged = np.append(0.0, np.cumsum(np.maximum(ampere[1:], 0.0) * np.diff(second))) / 3600.0
    moving = np.where(np.abs(ampere) > 2e-3 * np.abs(ampere).max(), np.sign(ampere), 0.0)
    return {
        "hysteresis_instant": [[_last_sign(moving)]],
        "hysteresis_one_state": [[_loop(soc, moving, rate)] for rate in (8.0, 20.0, 50.0)],
        "resistance_asymmetry": [[ampere * (ampere > 0)]],
        "resistance_soc": [[ampere * course for course in courses]],
        "polarisation_soc": [
            [sum(r * lagged(second, ampere * c, tau) for r, tau in pairs) for c in courses]
        ],
        "slow_diffusion": [[lagged(second, ampere, tau)] for tau in (700.0, 1500.0, 3500.0)],
        "charge_transfer_nonlinearity": [
            [np.arcsinh(ampere / scale)] for scale in np.abs(ampere).max() * np.array([0.1, 0.3])
        ],
        "resistance_temperature": [[warmer * one for one in elements]],
        "entropic_ocv": [[warmer, warmer * (soc - 0.5)]],
        "self_heating": [[one * total] for one in rise],
        "capacity_temperature": [[warmer * slope * (soc - soc[0])]],
        "coulombic_inefficiency": [[slope * charged]],
        "leakage": [[slope * second]],
        "current_offset": [[slope * second]],
        "capacity_error": [[slope * (soc - soc[0])]],
        "ocv_edge": [[np.exp(-soc / 0.08)], [np.exp((soc - 1) / 0.08)]],
        "voltage_offset": [[np.ones(soc.size)]],
        "voltage_gain": [[full["volt"]]],
        "time_skew": [[np.gradient(full["volt"], second)]],
    }


def _last_sign(moving):
    """Sign of the last current that moved charge, from the charge before the record on."""
    place = np.maximum.accumulate(np.where(moving != 0, np.arange(moving.size), 0))
    return np.where(moving[place] == 0, 1.0, moving[place])


def _loop(soc, moving, rate):
    """Hysteresis state of one loop, reached after 1/rate of the charge."""
    passed = np.append(0.0, np.cumsum(np.abs(np.diff(soc)))) * rate
    return np.exp(-passed) + lagged(passed, _last_sign(moving), 1.0)


def explained(effect: np.ndarray, tangent: np.ndarray, signatures: dict) -> dict[str, float]:
    """By name, the share [1] of the squared rows of an effect that its shapes explain at best.

    Parameters
    ----------
    effect : rows that the effect leaves [V]. tangent, signatures : of `left` without the effect.
    """
    basis = np.linalg.qr(tangent)[0]
    wanted = effect - basis @ (basis.T @ effect)
    power = wanted @ wanted
    return {
        name: max(_share(group, basis, wanted, power) for group in groups)
        for name, groups in signatures.items()
    }


def _share(group, basis, wanted, power):
    own = group - basis @ (basis.T @ group)
    size = np.linalg.norm(own, axis=0)
    own = own[:, size > 1e-6 * np.linalg.norm(group, axis=0)]
    if own.size == 0 or power == 0:
        return 0.0
    onto = np.linalg.qr(own)[0].T @ wanted
    return float(onto @ onto / power)


def visible(with_it: Left, without: Left, noise_volt: float) -> bool:
    """Whether clearly more is left with an effect than without it, noise included."""
    pairs = (
        (with_it.fit_volt, without.fit_volt, FIT_FACTOR),
        (with_it.validation_volt, without.validation_volt, VALIDATION_FACTOR),
    )
    return any(
        np.hypot(more, noise_volt) > factor * np.hypot(less, noise_volt)
        for more, less, factor in pairs
    )


def _rms(volt):
    return float(np.sqrt(np.mean(volt**2)))
