"""The pulses of a cell's tests by each identification method: from frames to a table."""

from cellwright.records import inputs
from cellwright.records.facts import MeasuredTest
from cellwright.records.repeats import repeats, steps_elsewhere
from cellwright.result import Result
from pulse_methods.comparison import compare_methods
from pulse_methods.pulse_records import PulseTest, counted_here


def compare_identification_methods(cell, basis, tests, **limits):
    """R0 and two RC pairs from the same pulses by each identification method, side by side.

    Parameters
    ----------
    cell : CellFacts or mapping.
    basis : result of `basis`.
    tests : (test, clean series, result of `segment`) each, of tests with pulses.
    limits : pulses_per_cell, samples, rest_lengths, as of `pulse_records.pulse_records`.

    Returns
    -------
    comparison : Table; one row a pulse and method: r0_ohm, r1_ohm, r2_ohm [ohm], tau1_second,
        tau2_second [s], rmse_volt [V], evaluations, and the reason where a method has no circuit.
        Without a pulse that counts there is no row, and `notes` say why.

    Source: thesis 2.3 and table 2.2; lab/methods.md.
    """
    measured = [
        PulseTest(
            inputs.test_facts(test), inputs.columns(series, *inputs.COUNTED), inputs.steps(steps)
        )
        for test, series, steps in tests
    ]
    found = repeats([MeasuredTest(test.facts, test.series) for test in measured])
    elsewhere = [steps_elsewhere(found, test.facts, test.steps) for test in measured]
    measured = [
        test._replace(steps=counted_here(test.steps, of))
        for test, of in zip(measured, elsewhere, strict=True)
    ]
    comparison = compare_methods(measured, inputs.basis(basis), inputs.cell_facts(cell), **limits)
    notes = (*found.notes, *comparison.left_out)
    return Result({"rows": comparison.rows}, notes=notes)
