"""One spectrum, from the points that can be trusted to circuit and relaxation times."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.arcs import (
    arcs,
    characteristic_frequency,
    charge_transfer,
    confused,
    contract,
)
from cellwright.protocols.impedance.circuits import THESIS, circuit_impedance
from cellwright.protocols.impedance.constraints import parse_constraints
from cellwright.protocols.impedance.drt import peaks, relaxation_times
from cellwright.protocols.impedance.evidence import best, compare, with_inductance
from cellwright.protocols.impedance.fit import check, fit_circuit, zero_crossing
from cellwright.protocols.impedance.trusted import trusted_points

# A valid spectrum leaves its noise, some tenths of a per cent; a drifting cell leaves per cents.
SUSPICIOUS = 0.01
POOR = 0.05
UNSTEADY_KELVIN = 1.0


class Analysis(NamedTuple):
    """What the pipeline stores of a spectrum: `row` of stage `eis`; `curve`, `parameters`,
    `candidates`, `distribution` and `processes` of the stages `eis_curve`, `eis_parameters`,
    `eis_candidates`, `drt` and `drt_peaks`; `notes` for the report."""

    row: dict
    curve: dict
    parameters: list
    candidates: list
    distribution: dict
    processes: list
    notes: tuple


def analyse(
    frequency_hertz,
    impedance_ohm,
    *,
    temperature_celsius=None,
    circuit=THESIS,
    candidates=(),
    choose="circuit",
    inductance="model",
    drift_tolerance=0.01,
    starts=8,
    constraints=(),
):
    """Test a spectrum, fit a circuit to what can be trusted of it, and find its relaxation times.

    Parameters
    ----------
    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].
    temperature_celsius : (n,) of the cell during the spectrum [°C], where it was recorded.
    circuit, starts : as in `fit_circuit`. constraints : on its parameters, see
        `parse_constraints`.
    candidates : circuits to compare with it.
    choose : "circuit" keeps `circuit`; "bic" or "cross_validation" take the best candidate.
    inductance, drift_tolerance : as in `trusted_points`.

    Returns
    -------
    analysis : Analysis.

    Raises
    ------
    Refusal : as `fit_circuit` and `trusted_points`.
    """
    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    check(frequency, impedance)
    trusted = trusted_points(
        frequency, impedance, drift_tolerance=drift_tolerance, inductance=inductance
    )
    points = frequency[trusted.keep], impedance[trusted.keep]
    names = [with_inductance(name, points[1]) for name in (circuit, *candidates)]
    fixed, tied = parse_constraints(constraints)
    given = fit_circuit(*points, circuit=names[0], starts=starts, fixed=fixed, tied=tied)
    compared = compare(*points, dict.fromkeys(names), starts=starts)
    preferred = best(compared, criterion="bic" if choose == "circuit" else choose)
    fit = given if choose == "circuit" else preferred.fit
    distribution = relaxation_times(*points)
    row = _row(fit, frequency, impedance, trusted, preferred) | _warmth(temperature_celsius)
    return Analysis(
        row=row,
        curve=_curve(fit, frequency, impedance, trusted),
        parameters=_parameters(fit),
        candidates=_candidates(compared, fit),
        distribution={
            "tau_second": distribution.tau_second,
            "gamma_ohm": distribution.gamma_ohm,
        },
        processes=peaks(distribution),
        notes=tuple(_notes(row, fit, trusted, points[0])),
    )


def _row(fit, frequency, impedance, trusted, preferred):
    arc, used = charge_transfer(fit), frequency[trusted.keep]
    top = characteristic_frequency(arc, fit.values) if arc else np.nan
    return {
        "circuit": fit.circuit,
        **contract(fit),
        "rms_relative_residual": fit.rms_relative_residual,
        "kramers_kronig_residual": trusted.rms,
        "r_zero_crossing_ohm": zero_crossing(frequency, impedance),
        "characteristic_frequency_hertz": top,
        "arc_in_range": bool(used.min() <= top <= used.max()),
        "charge_transfer_told": not confused(fit),
        "points": len(frequency),
        "points_fitted": len(used),
        "bic": fit.bic,
        "preferred_circuit": preferred.circuit,
    }


def _warmth(celsius):
    known = celsius is not None and np.isfinite(celsius).any()
    span = np.nanmax(celsius) - np.nanmin(celsius) if known else np.nan
    return {
        "temperature_celsius": float(np.nanmedian(celsius)) if known else np.nan,
        "temperature_span_kelvin": float(span),
    }


def _curve(fit, frequency, impedance, trusted):
    fitted = circuit_impedance(fit.circuit, frequency, fit.values)
    return {
        "frequency_hertz": frequency,
        "impedance_real_ohm": impedance.real,
        "impedance_imaginary_ohm": impedance.imag,
        "fitted_real_ohm": fitted.real,
        "fitted_imaginary_ohm": fitted.imag,
        "in_fit": trusted.keep,
        "kramers_kronig_real": trusted.residual.real,
        "kramers_kronig_imaginary": trusted.residual.imag,
    }


def _parameters(fit):
    return [
        {
            "circuit": fit.circuit,
            "parameter": name,
            "value": float(fit.values[k]),
            "std": float(fit.std[k]),
            "at_bound": name in fit.at_bound,
            **{
                f"correlation_{other}": float(fit.correlation[k, m])
                for m, other in enumerate(fit.names)
            },
        }
        for k, name in enumerate(fit.names)
    ]


def _candidates(compared, fit):
    least = min((one.bic for one in compared if one.fit is not None), default=np.nan)
    return [
        {
            "circuit": one.circuit,
            "free_parameters": one.fit.free if one.fit else 0,
            "rms_relative_residual": one.fit.rms_relative_residual if one.fit else np.nan,
            "cross_validation_residual": one.cross_validation_residual,
            "delta_bic": one.bic - least,
            "at_bound": ", ".join(one.fit.at_bound) if one.fit else "",
            "chosen": one.circuit == fit.circuit,
            "reason": one.reason,
        }
        for one in compared
    ]


def _notes(row, fit, trusted, used):
    yield from trusted.notes
    if row["temperature_span_kelvin"] > UNSTEADY_KELVIN:
        yield f"temperature moved by {row['temperature_span_kelvin']:.1f} K during the spectrum"
    if trusted.rms > SUSPICIOUS:
        yield (
            f"the spectrum breaks the Kramers-Kronig relations by {trusted.rms:.1%} RMS: the cell "
            "drifted or was not linear"
        )
    if fit.rms_relative_residual > POOR:
        yield (
            f"circuit {fit.circuit} misses the spectrum by {fit.rms_relative_residual:.1%} RMS: "
            f"its parameters do not describe this cell; {row['preferred_circuit']} comes closest"
        )
    if fit.at_bound:
        yield f"not determined, at the limit of the search: {', '.join(fit.at_bound)}"
    for arc in arcs(fit.circuit):
        top = characteristic_frequency(arc, fit.values)
        if not used.min() <= top <= used.max():
            yield (
                f"the arc of {fit.names[arc.r[0]]} has its top at {top:.3g} Hz, outside the "
                f"frequencies fitted ({used.min():.3g} to {used.max():.3g} Hz): extrapolated"
            )
    if reason := confused(fit):
        yield f"charge transfer and diffusion cannot be told apart: {reason}"
