"""One spectrum, from circuit fit to Kramers-Kronig test, as the pipeline stores it."""

from typing import NamedTuple

from cellwright.protocols.impedance.fit import fit_circuit
from cellwright.protocols.impedance.kramers_kronig import linear_kramers_kronig

# A valid spectrum leaves its noise, some tenths of a per cent; a drifting cell leaves per cents.
SUSPICIOUS = 0.01
POOR = 0.05


class Analysis(NamedTuple):
    """`row` of the stage `eis`, `curve` of the stage `eis_curve`, and `notes` for the report."""

    row: dict
    curve: dict
    notes: tuple


def analyse(frequency_hertz, impedance_ohm):
    """Fit the thesis' circuit to a spectrum, and test whether the spectrum can be trusted.

    Parameters
    ----------
    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].

    Returns
    -------
    analysis : Analysis.

    Raises
    ------
    Refusal : as `fit_circuit` and `linear_kramers_kronig`.
    """
    fit = fit_circuit(frequency_hertz, impedance_ohm)
    test = linear_kramers_kronig(frequency_hertz, impedance_ohm)
    estimates = list(zip(fit.names, fit.values.tolist(), fit.std.tolist(), strict=True))[:5]
    row = {
        "circuit": fit.circuit,
        **{name: value for name, value, _ in estimates},
        **{f"{name}_std": std for name, _, std in estimates},
        "rms_relative_residual": fit.rms_relative_residual,
        "kramers_kronig_residual": test.rms_relative_residual,
        "r_zero_crossing_ohm": fit.r_zero_crossing_ohm,
    }
    curve = {
        "frequency_hertz": frequency_hertz,
        "impedance_real_ohm": impedance_ohm.real,
        "impedance_imaginary_ohm": impedance_ohm.imag,
        "fitted_real_ohm": fit.fitted_ohm.real,
        "fitted_imaginary_ohm": fit.fitted_ohm.imag,
    }
    return Analysis(row, curve, tuple(_notes(fit, test)))


def _notes(fit, test):
    if test.rms_relative_residual > SUSPICIOUS:
        yield (
            f"the spectrum breaks the Kramers-Kronig relations by "
            f"{test.rms_relative_residual:.1%} RMS: the cell drifted or was not linear"
        )
    if fit.rms_relative_residual > POOR:
        yield (
            f"circuit {fit.circuit} misses the spectrum by {fit.rms_relative_residual:.1%} RMS: "
            f"its parameters do not describe this cell"
        )
    if fit.at_bound:
        yield f"not determined, at the limit of the search: {', '.join(fit.at_bound)}"
