"""One spectrum, from the points that can be trusted to circuit, arcs and relaxation times."""

import numpy as np

from cellwright.messages import Said, doubt_columns, listed
from cellwright.protocols.impedance.arcs import (
    charge_transfer_hertz,
    contract,
    tops,
    why_inseparable,
)
from cellwright.protocols.impedance.candidates import (
    MISSES,
    Candidate,
    candidate_of,
    misses,
    widened,
)
from cellwright.protocols.impedance.circuits import (
    circuit_impedance,
    parse,
    parse_constraints,
)
from cellwright.protocols.impedance.course import Spectrum, follow, partner
from cellwright.protocols.impedance.drt import peaks, relaxation_times
from cellwright.protocols.impedance.fit import check, fit_circuit
from cellwright.protocols.impedance.trust import DRIFT_TOLERANCE, trusted_points
from cellwright.protocols.messages import say
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.doubts import unlike_size
from cellwright.settings import Impedance

IMPEDANCE = Impedance()


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


SPECTRUM = ("frequency_hertz", "impedance_real_ohm", "impedance_imaginary_ohm")


def spectra_together(spectra, settings=None, **changes):
    """Circuit that all spectra of a cell prefer, and its arc of charge transfer in each of them.

    spectra : (test, spectrum) each, spectra as in `impedance`; of the tests count SoC, temperature
        and cycle. One that `impedance` refuses takes no part.
    settings : `settings.Impedance`.

    Returns rows, one a test and circuit, for `impedance`. Raises Refusal: no spectrum can be used.
    Source: docs/impedance.md.
    """
    choice = inputs.settings_of(Impedance, settings, changes)._asdict()
    inductance = choice.pop("inductance")
    taken, notes = [], []
    for test, spectrum in spectra:
        about = inputs.test_facts(test)
        made_at = {
            "celsius": about.ambient_temperature_celsius,
            "soc": about.soc,
            "cycle": about.cycle,
        }
        try:
            one = trusted_spectrum(*_complex(spectrum)[:2], inductance=inductance, **made_at)[0]
        except Refusal as refusal:
            notes.append(f"{about.test} takes no part: {refusal}")
        else:
            taken.append((about.test, one))
    if not taken:
        raise Refusal("; ".join(notes) or "there is no spectrum")
    fixed, tied = parse_constraints(choice.pop("constraints"))
    followed = follow([one for _, one in taken], **choice, fixed=fixed, tied=tied)
    rows = [
        {"test": test} | row
        for (test, _), rows in zip(taken, followed, strict=True)
        for row in rows
    ]
    return Result({"rows": rows}, notes=tuple(notes))


def impedance(spectrum, settings=None, *, cell=None, doubt="", test=None, together=None, **changes):
    """One spectrum analysed: Kramers-Kronig test, circuit fit, distribution of relaxation times.

    spectrum : DataFrame or columns: frequency_hertz [Hz], impedance_real_ohm and
        impedance_imaginary_ohm [ohm], (n,) each.
    settings : `settings.Impedance`. cell : its rating is held against the impedance; None: it is
        not. doubt : what its file says against it, as `read` gives it.
    together : result of `spectra_together` or its rows, among them those of `test`; None: the
        spectrum stands alone.

    Returns rows, the row of stage `eis`; curve, parameters, candidates, distribution and processes:
    of the fit, the tests and the relaxation times. Raises Refusal: an unknown circuit, too few
    points, or none that can be trusted; `test` is not among the spectra together.
    Source: thesis 3.2; docs/impedance.md.
    """
    settings = inputs.settings_of(Impedance, settings, changes)
    frequency, impedance, columns = _complex(spectrum)
    together = None if together is None else _of_test(together, test)
    spectrum, trusted = trusted_spectrum(frequency, impedance, inductance=settings.inductance)
    fixed, tied = parse_constraints(settings.constraints)
    if together is None:
        names = ("circuit", "candidates", "choose")
        about = {name: getattr(settings, name) for name in names}
        (together,) = follow([spectrum], **about, fixed=fixed, tied=tied)
    compared = _again(spectrum.points, together, fixed=fixed, tied=tied)
    chosen, preferred = (
        next(k for k, row in enumerate(together) if row[which]) for which in ("chosen", "preferred")
    )
    fit = compared[chosen].fit
    hertz = charge_transfer_hertz(fit, together[chosen]["charge_transfer_hertz"])
    if misses(fit, trusted.rms):
        fit = widened(fit, len(spectrum.frequency_hertz))
    others = [each for k, each in enumerate(compared) if k != chosen and each.fit is not None]
    distribution, off_course = relaxation_times(*spectrum.points), together[chosen]["off_course"]
    row = _row(fit, frequency, impedance, trusted, hertz) | _temperature(
        columns.get("surface_temperature_celsius")
    )
    if settings.choose != "circuit":
        shares = [(each.fit, part["weight"]) for each, part in zip(compared, together, strict=True)]
        row |= shared_deviations(fit, hertz, shares)
    said = (
        Said(doubt, "impedance.file"),
        doubt_of_size(impedance, None if cell is None else inputs.rating(cell)),
        doubt_of(fit, trusted.rms, [each.fit for each in others], hertz, row),
        Said(off_course, "impedance.off_course"),
    )
    row["charge_transfer_told"] &= not off_course
    row["preferred_circuit"] = compared[preferred].fit.circuit
    notes = tuple(_notes(row, fit, trusted, spectrum.frequency_hertz, off_course))
    row |= doubt_columns(said)
    tables = {
        "rows": [row],
        "curve": _curve(fit, frequency, impedance, trusted),
        "parameters": _parameters(fit),
        "candidates": _candidates(compared, together),
        "distribution": {
            "tau_second": distribution.tau_second,
            "gamma_ohm": distribution.gamma_ohm,
        },
        "processes": peaks(distribution),
    }
    return Result(tables, notes=notes)


def _complex(spectrum):
    """Frequency (n,) [Hz], impedance (n,) complex [Ω] and all columns of a spectrum."""
    columns = inputs.columns(spectrum, *SPECTRUM)
    frequency, real, imaginary = (columns[name] for name in SPECTRUM)
    # The imaginary part has its sign: capacitive arcs are negative.
    return frequency, real + 1j * imaginary, columns


def _of_test(together, test):
    """Rows of one test among the spectra together."""
    rows = inputs.rows(together)
    name = None if test is None else inputs.test_facts(test).test
    found = [row for row in rows if row["test"] == name]
    if not found:
        known = ", ".join(dict.fromkeys(row["test"] for row in rows))
        raise Refusal(f"no spectrum {name} among those together: {known}; `test` names it")
    return found


def trusted_spectrum(
    frequency_hertz,
    impedance_ohm,
    *,
    inductance=IMPEDANCE.inductance,
    drift_tolerance=DRIFT_TOLERANCE,
    **conditions,
):
    """A measured spectrum as `follow` takes it, and what `trusted_points` says of all its points.

    frequency_hertz, impedance_ohm, inductance, drift_tolerance : as in `trusted_points`.
    conditions : celsius, soc, cycle of Spectrum.

    Returns spectrum: Spectrum. trusted: Trusted. Raises Refusal: as `fit_circuit`.
    """
    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    check(frequency, impedance)
    trusted = trusted_points(
        frequency, impedance, drift_tolerance=drift_tolerance, inductance=inductance
    )
    points = frequency[trusted.keep], impedance[trusted.keep]
    # Without those of the leads there may be too few.
    check(*points)
    return Spectrum(*points, trusted.rms, **conditions), trusted


def _again(points, together, **options):
    """Candidates of one spectrum, each from where it ended among all spectra of its cell.

    together : rows of `follow`. options : fixed and tied parameters of the first.
    """
    again = []
    for k, row in enumerate(together):
        if row["reason"]:
            again.append(Candidate(row["candidate"], None, None, np.nan, np.nan, row["reason"]))
            continue
        start = dict(zip(parse(row["circuit"]).names, row["values"], strict=True))
        about = {} if k else options
        fit = fit_circuit(*points, circuit=row["circuit"], starts=1, start=start, **about)
        again.append(candidate_of(points, fit, fit, True, **about))
    return again


def _row(fit, frequency, impedance, trusted, hertz):
    """Columns of stage `eis` but for the temperature."""
    used = frequency[trusted.keep]
    return {
        "circuit": fit.circuit,
        **contract(fit, hertz),
        "rms_relative_residual": fit.rms_relative_residual,
        "kramers_kronig_residual": trusted.rms,
        "r_zero_crossing_ohm": zero_crossing(frequency, impedance),
        "characteristic_frequency_hertz": hertz,
        "arc_in_range": bool(used.min() <= hertz <= used.max()),
        "charge_transfer_told": not why_inseparable(fit, hertz),
        "points": len(frequency),
        "points_fitted": len(used),
        "bic": fit.bic,
    }


# What people compare of spectra of any circuit; the rest is the circuit's own.
TOLD = {"r_ohmic_ohm": "ohmic resistance", "r_charge_transfer_ohm": "charge transfer"}


def shared_deviations(fit, hertz, shares):
    """Deviations of the resistances that people compare, over all circuits: dict, NaN left out.

    The data know a resistance no better than they know the circuit: to the deviation in each comes
    how far it is from that of the chosen one, by the share of the circuit. The same arc is
    compared; a circuit without it says nothing.

    fit : CircuitFit of the chosen circuit. hertz : top of its arc of charge transfer. shares :
    (CircuitFit or None, share in what is known) of each candidate.

    Source: J. A. Hoeting et al., Statist. Sci. 14 (1999) 382, here about the chosen value.
    """
    here, seen = contract(fit, hertz), {fit.circuit: (fit, max(share for _, share in shares))}
    for other, share in shares:
        if other is not None and share > 0:
            seen.setdefault(other.circuit, (other, share))
    deviations = {}
    for name in TOLD:
        parts = []
        for other, share in seen.values():
            same = hertz if other is fit else partner(fit, hertz, other)
            there = contract(other, same)
            std = there[f"{name}_std"]
            if (name == "r_ohmic_ohm" or same > 0) and std > 0:
                parts.append((share, std**2 + (there[name] - here[name]) ** 2))
        if here[f"{name}_std"] > 0:
            weights, squares = np.array(parts).T
            deviations[f"{name}_std"] = float(np.sqrt(weights @ squares / weights.sum()))
    return deviations


def doubt_of(fit, kramers_kronig_rms, others, hertz, row):
    """What stands against a circuit's resistances, in words; "" where nothing does.

    Where it misses the spectrum, the other circuits that miss it less, or by less than twice as
    much, say by how much each of them may move: within two of its widened deviations that is no
    doubt. Where none comes so close nothing tells.

    fit : CircuitFit with its widened deviations. kramers_kronig_rms : of the test [1]. others :
    CircuitFit of each other candidate. hertz : top of its arc of charge transfer, which is compared
    with the arc of the other circuit that has its time constant. row : its columns of stage `eis`.
    """
    if not misses(fit, kramers_kronig_rms):
        return ""
    left = fit.rms_relative_residual
    close = [one for one in others if one.rms_relative_residual <= MISSES * left]
    if not close and left <= DRIFT_TOLERANCE:
        return ""
    if not close:
        return say("impedance.none_closer", missed=left, times=misses(fit, kramers_kronig_rms))
    closest = min(close, key=lambda one: one.rms_relative_residual)
    same = partner(fit, hertz, closest)
    there, moved = contract(closest, same), []
    for name, words in TOLD.items():
        off, within = there[name] - row[name], 2 * row[f"{name}_std"]
        compared = np.isfinite(off) and (name == "r_ohmic_ohm" or same > 0)
        if compared and not abs(off) <= within:
            change = off / row[name]
            moved.append(say("impedance.moved", what=words, ohm=1e3 * there[name], change=change))
    if not moved:
        return ""
    closer, other = closest.rms_relative_residual, closest.circuit
    return say("impedance.closer", missed=left, other=other, closer=closer, moved=listed(moved))


def _missed(fit, kramers_kronig_rms):
    """By how much a circuit misses a spectrum, in words."""
    times = misses(fit, kramers_kronig_rms)
    left = f"{fit.rms_relative_residual:.1%} RMS, {times:.2g} times the noise"
    return f"the circuit misses the spectrum by {left}: standard deviations widened"


def doubt_of_size(impedance, rated):
    """That a cell of this rating [Ah] has no such impedance (n,) [Ω], in words; "" where it may."""
    least = float(np.min(np.abs(impedance)))
    if not rated or not unlike_size(least, rated):
        return ""
    name = "milliohm" if least * rated > 1.0 else "ohm"
    return say(f"impedance.{name}", rated=rated, ohm=least)


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


def _candidates(compared, together):
    """Rows of stage `eis_candidates`: criteria of each circuit compared."""
    least = min((each.bic for each in compared if each.fit is not None), default=np.nan)
    return [
        {
            "circuit": row["candidate"],
            "reduced_circuit": row["circuit"],
            "free_parameters": each.fit.free if each.fit else 0,
            "rms_relative_residual": each.fit.rms_relative_residual if each.fit else np.nan,
            "cross_validation_residual": each.cross_validation_residual,
            "delta_bic": each.bic - least,
            "at_bound": row["at_bound"],
            "chosen": row["chosen"],
            "reason": each.reason,
        }
        for each, row in zip(compared, together, strict=True)
    ]


def _notes(row, fit, trusted, used, off_course):
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
        other = row["preferred_circuit"]
        yield (
            f"circuit {fit.circuit} misses the spectrum by {fit.rms_relative_residual:.1%} RMS: "
            "its parameters do not describe this cell"
            + (f"; {other} comes closest" if other != fit.circuit else "")
        )
    elif misses(fit, trusted.rms):
        yield f"{fit.circuit}: {_missed(fit, trusted.rms)}"
    if fit.at_bound:
        yield f"not determined, at the limit of the search: {', '.join(fit.at_bound)}"
    hertz = row["characteristic_frequency_hertz"]
    for top, arc in tops(fit):
        # Slower ones are how the circuit writes a tail.
        if top >= hertz and not used.min() <= top <= used.max():
            about = {"arc": fit.names[arc.r[0]].removesuffix("_ohm").upper(), "top": top}
            yield say("impedance.arc_outside", low=used.min(), high=used.max(), **about)
    if reason := why_inseparable(fit, hertz):
        yield f"charge transfer and diffusion cannot be told apart: {reason}"
    if off_course:
        yield off_course
