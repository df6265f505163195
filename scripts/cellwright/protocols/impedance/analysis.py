"""One spectrum, from the points that can be trusted to circuit, arcs and relaxation times."""

import re
from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.protocols.impedance.circuits import (
    BENT_LEADS,
    LEADS,
    PARALLEL,
    SERIES,
    SYMBOLS,
    THESIS,
    circuit_impedance,
    parse,
    parse_constraints,
    series_resistance,
)
from cellwright.protocols.impedance.drt import peaks, relaxation_times
from cellwright.protocols.impedance.fit import (
    check,
    fit_circuit,
)
from cellwright.protocols.impedance.trust import DRIFT_TOLERANCE, trusted_points
from cellwright.refusal import Refusal
from cellwright.series.doubts import unlike_size
from cellwright.settings import Impedance

IMPEDANCE = Impedance()

CAPACITIVE = {SYMBOLS["CPE"], SYMBOLS["C"]}
DIFFUSION = {SYMBOLS["W"], SYMBOLS["FLW"], SYMBOLS["FSW"], SYMBOLS["G"]}


class Arc(NamedTuple):
    """A capacitance parallel to a branch with a resistance, as places among the parameters.

    t, p : of the capacitance (p is None for a plain one). r : resistances of the other branch.
    """

    t: int
    p: int | None
    r: tuple


def arcs(circuit):
    """Arcs of a circuit (its text or tree), in the order of their parameters: list of Arc."""
    tree = parse(circuit) if isinstance(circuit, str) else circuit
    candidates = [
        _arc(tree, *sides)
        for kind, first, second in zip(tree.kinds, tree.left, tree.right, strict=True)
        if kind == PARALLEL
        for sides in ((first, second), (second, first))
    ]
    return sorted((arc for arc in candidates if arc is not None), key=lambda arc: arc.t)


def _arc(tree, capacitive, branch):
    """Arc of two parallel branches; None unless the first is a capacitance, the other has an R."""
    resistances = _in_series(tree, branch, {SYMBOLS["R"]})
    if tree.kinds[capacitive] not in CAPACITIVE or not resistances:
        return None
    first_parameter = tree.at[capacitive]
    exponent = first_parameter + 1 if tree.kinds[capacitive] == SYMBOLS["CPE"] else None
    return Arc(first_parameter, exponent, tuple(tree.at[k] for k in resistances))


def characteristic_frequency(arc, values):
    """Frequency at the top of an arc, (1/(R·T))^(1/P)/2π [Hz], at parameters `values` (p,)."""
    r = sum(values[k] for k in arc.r)
    power = 1.0 if arc.p is None else values[arc.p]
    return float((1 / (r * values[arc.t])) ** (1 / power) / (2 * np.pi))


def charge_transfer(fit):
    """Arc of charge transfer, the slowest of the circuit; None without arcs."""
    return min(
        arcs(fit.circuit), key=lambda arc: characteristic_frequency(arc, fit.values), default=None
    )


def contract(fit):
    """Columns of the results contract from any circuit: dict of each value and its `_std`.

    r_ohmic_ohm is the resistance that all current passes; r_charge_transfer_ohm, cpe_t and cpe_p
    are those of the slowest arc; warburg_y0 that of the first semi-infinite diffusion. NaN for what
    the circuit does not have.
    """
    tree, arc = parse(fit.circuit), charge_transfer(fit)
    diffusion = _parameters_of(tree, {SYMBOLS["W"]})
    places = {
        "r_ohmic_ohm": series_resistance(tree),
        "r_charge_transfer_ohm": arc.r[0] if arc else None,
        "cpe_t": arc.t if arc else None,
        "cpe_p": arc.p if arc else None,
        "warburg_y0": diffusion[0] if diffusion else None,
        "inductance_henry": tree.roles.index("inductance") if "inductance" in tree.roles else None,
    }
    row = {}
    for name, index in places.items():
        row[name] = np.nan if index is None else float(fit.values[index])
        row[f"{name}_std"] = np.nan if index is None else float(fit.std[index])
    return row


def why_inseparable(fit):
    """Why charge transfer and diffusion cannot be told apart; empty where they can, or where the
    circuit lacks one of the two."""
    tree, arc = parse(fit.circuit), charge_transfer(fit)
    diffusion = _parameters_of(tree, DIFFUSION)
    if arc is None or not diffusion:
        return ""
    r = arc.r[0]
    for k in (r, *diffusion):
        share = fit.std[k] / fit.values[k]
        if not share <= 0.5:  # also NaN: at a limit, or not determined
            return f"{fit.names[k]} is {f'known to {share:.0%} only' if share > 0 else 'not told'}"
    correlations = [abs(fit.correlation[r, k]) for k in diffusion]
    # Two parameters that move together like this are one number in the data, not two.
    if not max(correlations) > 0.9:
        return ""
    closest = fit.names[diffusion[int(np.argmax(correlations))]]
    return f"{fit.names[r]} and {closest} are correlated by {max(correlations):.2f}"


def _parameters_of(tree, kinds):
    """Places of the first parameter of each element of these kinds."""
    return [index for index, kind in zip(tree.at, tree.kinds, strict=True) if kind in kinds]


def _in_series(tree, node, kinds):
    """Elements of these kinds that all current of a branch passes."""
    if tree.kinds[node] == SERIES:
        sides = (tree.left[node], tree.right[node])
        return [element for side in sides for element in _in_series(tree, side, kinds)]
    return [node] if tree.kinds[node] in kinds else []


CRITERIA = {"bic": "bic", "cross_validation": "cross_validation_residual"}


class Candidate(NamedTuple):
    """A circuit with its fit and criteria; `fit` is None where the `reason` says why.

    cross_validation_residual : RMS of the relative error on points that were left out.
    """

    circuit: str
    fit: object
    bic: float
    cross_validation_residual: float
    reason: str


def with_inductance(circuit, impedance_ohm):
    """Text of the circuit, with the leads' inductance in series where the spectrum shows any."""
    has = "L" in re.findall(r"[A-Z]+", circuit)
    return circuit if has or not (impedance_ohm.imag > 0).any() else f"{LEADS}-{circuit}"


# ASSUME: What the Kramers-Kronig test leaves of a spectrum is its noise; a circuit that leaves
# more than twice as much is not that of the cell.
MISSES = 2.0


def misses(fit, kramers_kronig_rms):
    """How many times more a circuit leaves of a spectrum than the test, 0 where that is noise."""
    ratio = fit.rms_relative_residual / max(kramers_kronig_rms, 1e-12)
    return ratio if ratio > MISSES else 0.0


def with_bent_leads(points, fit, kramers_kronig_rms, **options):
    """The fit with the leads' inductance beside a resistance, where that alone explains a misfit.

    points : frequency [Hz] and impedance [Ω] of the fit. fit : CircuitFit. kramers_kronig_rms : of
    the test. options : as of `fit_circuit`.

    Returns fit: CircuitFit, the same one where its circuit follows the spectrum, has no inductance
    in front, or misses it with bent leads as well.
    """
    if not (misses(fit, kramers_kronig_rms) and fit.circuit.startswith(f"{LEADS}-")):
        return fit
    bent = fit_circuit(*points, circuit=BENT_LEADS + fit.circuit[len(LEADS) :], **options)
    return fit if misses(bent, kramers_kronig_rms) or bent.at_bound else bent


def widened(fit, points):
    """The fit with deviations for a misfit that is no noise.

    It is smooth: the points tell it no better than as many as the circuit has free parameters, and
    one, would.
    """
    return fit._replace(std=fit.std * np.sqrt(2 * points / (fit.free + 1)))


def compare(frequency_hertz, impedance_ohm, circuits, **options):
    """Fits of several circuits to the same points, with their criteria.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω]. circuits : texts.
    options : of each fit, see `fit_circuit`.

    Returns candidates: list of Candidate in the order given.

    Source: G. Schwarz, Ann. Statist. 6 (1978) 461 (Bayesian information criterion).
    """
    points, candidates = (frequency_hertz, impedance_ohm), []
    for circuit in circuits:
        try:
            fit = fit_circuit(*points, circuit=circuit, **options)
        except Refusal as refusal:
            candidates.append(Candidate(circuit, None, np.nan, np.nan, str(refusal)))
        else:
            missed = _cross_validation_error(*points, fit, **options)
            candidates.append(Candidate(circuit, fit, fit.bic, missed, ""))
    return candidates


def best(candidates, *, criterion):
    """The candidate with the least criterion ("bic" or "cross_validation") among those fitted whose
    parameters stay within their limits, or among all fitted where none does.

    Raises Refusal: none could be fitted, or an unknown criterion.
    """
    if criterion not in CRITERIA:
        raise Refusal(f"criterion {criterion!r}; known: {', '.join(CRITERIA)}")
    fitted = [candidate for candidate in candidates if candidate.fit is not None]
    if not fitted:
        raise Refusal("; ".join(f"{each.circuit}: {each.reason}" for each in candidates))
    inside = [candidate for candidate in fitted if not candidate.fit.at_bound]
    return min(inside or fitted, key=lambda candidate: getattr(candidate, CRITERIA[criterion]))


def _cross_validation_error(frequency, impedance, fit, **options):
    """RMS of the relative error [1] on every fifth point in turn, fitted to the others."""
    once = options | {"starts": 1, "start": dict(zip(fit.names, fit.values, strict=True))}
    # Every fifth point by frequency, so that none but the outermost is extrapolated.
    rank, errors = np.argsort(np.argsort(frequency)) % 5, []
    for fold in range(5):
        fitted, predicted = rank != fold, rank == fold
        refit = fit_circuit(frequency[fitted], impedance[fitted], circuit=fit.circuit, **once)
        guess = circuit_impedance(fit.circuit, frequency[predicted], refit.values)
        errors.append(np.abs(guess / impedance[predicted] - 1))
    return rms(np.concatenate(errors))


def zero_crossing(frequency_hertz, impedance_ohm):
    """Real part where the imaginary part changes from inductive to capacitive, by a line [Ω].

    The crossing at the highest frequency counts; NaN without any: the leads hide it, or the
    spectrum ends before.
    """
    order = np.argsort(-np.asarray(frequency_hertz, float))
    real, imaginary = impedance_ohm.real[order], impedance_ohm.imag[order]
    crossings = np.flatnonzero((imaginary[:-1] > 0) & (imaginary[1:] <= 0))
    if not len(crossings):
        return np.nan
    before = crossings[0]
    share = imaginary[before] / (imaginary[before] - imaginary[before + 1])
    return float(real[before] + share * (real[before + 1] - real[before]))


class Analysis(NamedTuple):
    """Results of one spectrum: `row` of stage `eis`; `curve`, `parameters`, `candidates`,
    `distribution` and `processes` of the stages `eis_curve`, `eis_parameters`, `eis_candidates`,
    `drt` and `drt_peaks`; `notes` for the report."""

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
    rated_capacity_ampere_hour=None,
    circuit=THESIS,
    candidates=(),
    choose=IMPEDANCE.choose,
    inductance=IMPEDANCE.inductance,
    drift_tolerance=DRIFT_TOLERANCE,
    constraints=(),
):
    """Circuit fitted to the valid points of a spectrum, its tests and its relaxation times.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].
    temperature_celsius : (n,) of the cell during the spectrum [°C], where it was recorded.
    rated_capacity_ampere_hour : [Ah], which the impedance is held against; None: it is not.
    circuit : as in `fit_circuit`. constraints : on its parameters, see `parse_constraints`.
    candidates : circuits to compare with it.
    choose : "circuit" keeps `circuit`; "bic" or "cross_validation" take the best candidate.
    inductance, drift_tolerance : as in `trusted_points`.

    Returns analysis: Analysis. Raises Refusal: as `fit_circuit` and `trusted_points`.
    """
    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    check(frequency, impedance)
    trusted = trusted_points(
        frequency, impedance, drift_tolerance=drift_tolerance, inductance=inductance
    )
    points = frequency[trusted.keep], impedance[trusted.keep]
    names = [with_inductance(name, points[1]) for name in (circuit, *candidates)]
    fixed, tied = parse_constraints(constraints)
    options = {"fixed": fixed, "tied": tied}
    given = with_bent_leads(
        points, fit_circuit(*points, circuit=names[0], **options), trusted.rms, **options
    )
    # Constraints are on the parameters of the given circuit.
    others = [name for name in dict.fromkeys(names[1:]) if name != given.circuit]
    compared = [*compare(*points, [given.circuit], **options), *compare(*points, others)]
    preferred = best(compared, criterion="bic" if choose == "circuit" else choose)
    fit = given if choose == "circuit" else preferred.fit
    if misses(fit, trusted.rms):
        fit = widened(fit, len(points[0]))
    distribution = relaxation_times(*points)
    row = _row(fit, frequency, impedance, trusted, preferred) | _temperature(temperature_celsius)
    size = _of_size(impedance, rated_capacity_ampere_hour)
    row["doubt"] = "; ".join(filter(None, [size, row["doubt"]]))
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
    """Columns of stage `eis` but for the temperature."""
    arc, used = charge_transfer(fit), frequency[trusted.keep]
    top = characteristic_frequency(arc, fit.values) if arc else np.nan
    return {
        "circuit": fit.circuit,
        **contract(fit),
        "rms_relative_residual": fit.rms_relative_residual,
        "kramers_kronig_residual": trusted.rms,
        "doubt": doubt_of(fit, trusted.rms, preferred.fit),
        "r_zero_crossing_ohm": zero_crossing(frequency, impedance),
        "characteristic_frequency_hertz": top,
        "arc_in_range": bool(used.min() <= top <= used.max()),
        "charge_transfer_told": not why_inseparable(fit),
        "points": len(frequency),
        "points_fitted": len(used),
        "bic": fit.bic,
        "preferred_circuit": preferred.circuit,
    }


# What people compare of spectra of any circuit; the rest is the circuit's own.
TOLD = {"r_ohmic_ohm": "ohmic resistance", "r_charge_transfer_ohm": "charge transfer"}


def doubt_of(fit, kramers_kronig_rms, closest):
    """What stands against a circuit's resistances, in words; "" where nothing does.

    Where it misses the spectrum the circuit that comes closest says by how much each of them moves:
    within two of its widened deviations that is no doubt. Where none comes closer nothing tells.

    fit : CircuitFit with its widened deviations. kramers_kronig_rms : of the test [1]. closest :
    CircuitFit of the preferred circuit.
    """
    if not misses(fit, kramers_kronig_rms):
        return ""
    if not closest.rms_relative_residual < fit.rms_relative_residual:
        return f"{_missed(fit, kramers_kronig_rms)}, and no circuit tried comes closer"
    here, there, moved = contract(fit), contract(closest), []
    for name, words in TOLD.items():
        off, within = there[name] - here[name], 2 * here[f"{name}_std"]
        if np.isfinite(off) and not abs(off) <= within:
            moved.append(f"{words} is {1e3 * there[name]:.3g} mΩ ({off / here[name]:+.0%})")
    if not moved:
        return ""
    missed, closer = (one.rms_relative_residual for one in (fit, closest))
    other = f"{closest.circuit} misses it by {closer:.1%}, and in it {' and '.join(moved)}"
    return f"the circuit misses the spectrum by {missed:.1%} RMS; {other}"


def _missed(fit, kramers_kronig_rms):
    """By how much a circuit misses a spectrum, in words."""
    times = misses(fit, kramers_kronig_rms)
    left = f"{fit.rms_relative_residual:.1%} RMS, {times:.2g} times what its own noise leaves"
    return f"the circuit misses the spectrum by {left}: deviations widened"


def _of_size(impedance, rated):
    """That a cell of this rating [Ah] has no such impedance (n,) [Ω], in words; "" where it may."""
    least = float(np.min(np.abs(impedance)))
    if not rated or not unlike_size(least, rated):
        return ""
    unit = "milliohm read as ohm" if least * rated > 1.0 else "ohm read as milliohm"
    return f"no cell of {rated:g} Ah has {least:.3g} ohm at its least: {unit}?"


def _temperature(celsius):
    """Columns of stage `eis`: median temperature [°C] and its span [K], NaN where not recorded."""
    measured = celsius is not None and np.isfinite(celsius).any()
    span = np.nanmax(celsius) - np.nanmin(celsius) if measured else np.nan
    return {
        "temperature_celsius": float(np.nanmedian(celsius)) if measured else np.nan,
        "temperature_span_kelvin": float(span),
    }


def _curve(fit, frequency, impedance, trusted):
    """Columns of stage `eis_curve`: measured and fitted impedance [Ω], residual of the test."""
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
    """Rows of stage `eis_parameters`: value, deviation and correlations of each parameter."""
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
    """Rows of stage `eis_candidates`: criteria of each circuit compared."""
    least = min((each.bic for each in compared if each.fit is not None), default=np.nan)
    return [
        {
            "circuit": each.circuit,
            "free_parameters": each.fit.free if each.fit else 0,
            "rms_relative_residual": each.fit.rms_relative_residual if each.fit else np.nan,
            "cross_validation_residual": each.cross_validation_residual,
            "delta_bic": each.bic - least,
            "at_bound": ", ".join(each.fit.at_bound) if each.fit else "",
            "chosen": each.circuit == fit.circuit,
            "reason": each.reason,
        }
        for each in compared
    ]


def _notes(row, fit, trusted, used):
    """Sentences for the report on what is doubtful in the fit; `used` are its frequencies [Hz]."""
    yield from trusted.notes
    if row["temperature_span_kelvin"] > 1.0:
        yield f"temperature moved by {row['temperature_span_kelvin']:.1f} K during the spectrum"
    # A valid spectrum leaves its noise, some tenths of a per cent; a drifting cell whole ones.
    if trusted.rms > 0.01:
        yield (
            f"the spectrum breaks the Kramers-Kronig relations by {trusted.rms:.1%} RMS: the cell "
            "drifted or was not linear"
        )
    if fit.rms_relative_residual > 0.05:
        yield (
            f"circuit {fit.circuit} misses the spectrum by {fit.rms_relative_residual:.1%} RMS: "
            f"its parameters do not describe this cell; {row['preferred_circuit']} comes closest"
        )
    elif misses(fit, trusted.rms):
        yield f"{fit.circuit}: {_missed(fit, trusted.rms)}"
    if fit.at_bound:
        yield f"not determined, at the limit of the search: {', '.join(fit.at_bound)}"
    for arc in arcs(fit.circuit):
        top = characteristic_frequency(arc, fit.values)
        if not used.min() <= top <= used.max():
            yield (
                f"the arc of {fit.names[arc.r[0]]} has its top at {top:.3g} Hz, outside the "
                f"frequencies fitted ({used.min():.3g} to {used.max():.3g} Hz): extrapolated"
            )
    if reason := why_inseparable(fit):
        yield f"charge transfer and diffusion cannot be told apart: {reason}"
