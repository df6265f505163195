"""The cell that its corrected model serves worst, and that model's voltage on any of its tests."""

import numpy as np

from cellwright.bias.compared import compared
from cellwright.bias.corrected import corrected_model, reference_and_others
from cellwright.bias.correction import correction
from cellwright.bias.courses import courses_of
from cellwright.bias.ways import with_given_models
from cellwright.circuits.model_file import simulate_model
from cellwright.records import inputs
from cellwright.records.record import laid_out
from cellwright.refusal import Refusal
from cellwright.settings import Models

MODELS = Models()


def worst_corrected(rows):
    """The cell of which the corrected model errs most beyond what the cell's own model does.

    A cell whose own model errs as much has a test that no model follows: that is said, and another
    is taken.

    rows : result of `compare_bias_ways`, or its rows.

    Returns dict: cell, rmse_volt and own_rmse_volt over all its tests [V], words.
    Raises Refusal: no corrected model was scored. Source: docs/bias.md.
    """
    rows = inputs.rows(rows)
    bias, own = _errors(rows, "bias"), _errors(rows, "own")
    if not bias:
        raise Refusal("no cell has a corrected model that was scored")
    worst = max(bias, key=lambda cell: bias[cell] ** 2 - own[cell] ** 2)
    words = f"{worst}: {1e3 * bias[worst]:.2g} mV, its own model {1e3 * own[worst]:.2g} mV"
    largest = max(bias, key=bias.get)
    if largest != worst:
        words += (
            f"; {largest} has the largest error, {1e3 * bias[largest]:.2g} mV, but its own model "
            f"errs by {1e3 * own[largest]:.2g} mV on the same tests"
        )
    errors = {"rmse_volt": bias[worst], "own_rmse_volt": own[worst]}
    return {"cell": worst, **errors, "words": words}


def _errors(rows, way):
    """Root mean square over the tests of each cell [V]."""
    by_cell = {}
    for row in rows:
        if row["way"] == way:
            by_cell.setdefault(row["cell"], []).append(row["rmse_volt"])
    return {cell: float(np.sqrt(np.mean(np.square(own)))) for cell, own in by_cell.items()}


def corrected_voltages(cells, name, tests, *, split_rest_second=MODELS.split_rest_second):
    """Voltage of a cell's corrected model on its tests, the cell left out of the calibration.

    cells : as of `compare_bias_ways`. name : of the cell among them. tests : of that cell.

    Returns dict test → (time [s], voltage [V]), (n,) each, as `missing_effect` takes them. Raises
    Refusal: the cell is not among them, or a test cannot be laid out. Source: docs/bias.md.
    """
    cells, tests = with_given_models(cells), inputs.tests(tests)
    found = [cell for cell in cells if cell.shown.cell == name]
    if not found:
        raise Refusal(f"no cell {name}; there are {', '.join(c.shown.cell for c in cells)}")
    shown, peers = found[0].shown, [c.shown for c in cells if c is not found[0]]
    reference, others = reference_and_others(shown, peers)
    base = courses_of(reference.model, reference.model["chosen"])
    change = correction(*compared(reference, [shown]), base, compared(reference, others))
    model = corrected_model(shown, reference, change)
    voltages = {}
    for test in tests:
        record = laid_out(test, model, found[0].facts, split_rest_second=split_rest_second)
        columns = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
        run = simulate_model(model, None, *columns, kind=record.kind)
        voltages[test.facts.test] = (record.test_time_second, run.voltage_volt)
    return voltages
