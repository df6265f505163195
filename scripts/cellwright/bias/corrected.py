"""Models of cells without pulses: the reference cell's, corrected by what the cell shows."""

import numpy as np
from scipy.special import stdtrit

from cellwright.bias.compared import compared
from cellwright.bias.correction import correction
from cellwright.bias.courses import KNOTS, courses_of
from cellwright.bias.features import resistance_ratio
from cellwright.bias.scaled import changed, scaled_reference
from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import simulate_model
from cellwright.circuits.parameters import model_result
from cellwright.numerics.statistics import rms
from cellwright.records.basis import reference_of
from cellwright.refusal import Refusal

LEVEL = 0.95
MOST_DRAWS = 24  # alternative models that an interval of the voltage is taken from
FORMS = {
    "scaling": "scaling",
    "charge": "its own charge",
    "terms": "the differences",
    "thesis": "the thesis' function",
}


def borrow_model(cell, peers):
    """Model of a cell without pulses, borrowed from the reference cell of its type.

    1. The reference is the first marked cell, else the largest. 2. What the cell's tests show
    against the reference corrects fast and slow resistance and OCV, each over SoC, calibrated on
    the other cells of the type (`correction.correction`). 3. Where that leaves only one factor on
    all resistances, the model is a scaled reference.

    cell : `bias.features.Shown`, what its tests show. peers : the same of modelled cells.

    Returns as `identify`, kind "bias" or "scaled"; the notes say by what, with the errors of cells
    left out. Raises Refusal: no peer has a model, or the cell shows too little.
    Source: thesis 4.5; docs/bias.md.
    """
    peers = [*map(with_given_model, peers)]
    reference, others = reference_and_others(cell, peers)
    base = courses_of(reference.model, reference.model["chosen"])
    found = correction(*compared(reference, [cell]), base, compared(reference, others))
    scaled = all(change.form == "scaling" for change in found.changes)
    model = (scaled_model if scaled else corrected_model)(cell, reference, found)
    return model_result(model | {"capacity_std_ampere_hour": cell.capacity_std_ampere_hour})


def with_given_model(cell):
    """Shown of a cell with the content of its model, where it has one."""
    return cell if cell.model is None else cell._replace(model=given.model(cell.model))


def reference_and_others(cell, peers):
    """The reference of a cell among its peers, and the other peers.

    Parameters
    ----------
    cell : Shown. peers : list of Shown, with models.

    Raises
    ------
    Refusal : no peer has a model, or the cell's capacity is not positive.
    """
    if not peers:
        raise Refusal("no cell of the same chemistry and rating has a model to borrow")
    if not cell.capacity_ampere_hour > 0:
        raise Refusal(f"capacity of {cell.cell} is {cell.capacity_ampere_hour} Ah; not positive")
    reference = reference_of(peers, capacity=lambda peer: peer.capacity_ampere_hour)
    return reference, [peer for peer in peers if peer is not reference]


def scaled_model(cell, reference, found=None):
    """The reference with the cell's capacity and its resistance ratio.

    Parameters
    ----------
    cell, reference : Shown. found : Correction that carried no more, for the notes; or None.

    Returns
    -------
    model : dict of schema cellwright-model/2, kind "scaled".
    """
    ratio, words = resistance_ratio(reference, cell)
    model = scaled_reference(
        reference.model, cell=cell.cell, capacity=cell.capacity_ampere_hour, resistance_ratio=ratio
    )
    notes = [*model["notes"], words]
    if found is not None:
        notes += [f"{len(found.cells)} cell(s) beside {reference.cell} can calibrate: no more"]
        notes += _errors(found)
    return model | {"notes": notes}


def corrected_model(cell, reference, found):
    """The reference's model with the corrections of a cell.

    Parameters
    ----------
    cell, reference : Shown. found : Correction.

    Returns
    -------
    model : dict of schema cellwright-model/2, kind "bias". Of R0 and all branches the resistances
        are scaled, at least to a tenth of the reference's; its conditions hold the standard
        deviation of R0 and of the OCV that the cells left out tell.
    """
    forms = {FORMS[change.form] for change in found.changes}
    count = f"calibrated on {len(found.cells)} cells" if found.cells else "not calibrated"
    notes = [f"bias-corrected from {reference.cell} by {', '.join(sorted(forms))}, {count}"]
    notes += [found.ratio_words] if "scaling" in forms or not found.cells else []
    notes += _errors(found)
    if found.outside:
        words = "; ".join(found.outside)
        notes.append(f"outside the calibration, its interval is wider: {words}")
    courses = [change.change for change in found.changes]
    model = _model(cell, reference, courses, notes)
    return _with_deviations(model, found) if len(found.cells) > 1 else model


def _model(cell, reference, courses, notes):
    def change(soc):
        fast, slow, ocv = (np.interp(soc, KNOTS, course) for course in courses)
        return np.exp(fast), np.exp(slow), ocv

    about = {"cell": cell.cell, "capacity": cell.capacity_ampere_hour}
    return changed(reference.model, change, kind="bias", notes=notes, knots=KNOTS, **about)


def _with_deviations(model, found):
    """The model with standard deviations of R0 and of its OCV, from the intervals of 95 %."""
    quantile = stdtrit(len(found.cells) - 1, 0.5 + LEVEL / 2)
    fast, _, ocv = found.changes
    of_log, of_ocv = fast.half_interval / quantile, ocv.half_interval / quantile

    def entry_of(entry):
        soc = entry["soc"]
        r0_std = np.asarray(entry["r0_ohm"]) * np.interp(soc, KNOTS, of_log)
        ocv_std = np.interp(soc, KNOTS, of_ocv)
        return entry | {"r0_std_ohm": r0_std.tolist(), "ocv_shift_std_volt": ocv_std.tolist()}

    members = [
        member | {"conditions": [entry_of(entry) for entry in member["conditions"]]}
        for member in model["members"]
    ]
    return model | {"members": members}


def _errors(found):
    """Sentence on the errors of the calibrating cells, each predicted from the others."""
    if len(found.cells) < 2:
        return []
    fast, slow, ocv = (rms(change.left_out) for change in found.changes)
    return [
        f"leave-one-cell-out errors: fast resistance {100 * fast:.2g} %, slow resistance "
        f"{100 * slow:.2g} %, OCV {1e3 * ocv:.2g} mV"
    ]


def alternatives(cell, reference, found):
    """Models that are as likely as the corrected one, by the errors of the calibrating cells.

    The errors that the corrections of one calibrating cell had together, when it was left out, are
    laid on this cell's corrections, widened as this cell is further out.

    Parameters
    ----------
    cell, reference : Shown. found : Correction.

    Returns
    -------
    models : list of dict of schema cellwright-model/2, at most `MOST_DRAWS`; none of fewer than
        two cells.
    """
    count = len(found.cells)
    if count < 2:
        return []
    drawn = np.unique(np.linspace(0, count - 1, min(count, MOST_DRAWS)).round().astype(int))
    models = []
    for place in drawn:
        courses = [one.change - one.left_out[place] * one.stretch[place] for one in found.changes]
        models.append(_model(cell, reference, courses, []))
    return models


def voltage_interval(model, others, record, *, model_error_volt):
    """Half interval of 95 % of a corrected model's voltage over a record [V].

    What the alternatives differ by, and what even a cell's own model errs by.

    Parameters
    ----------
    model : dict, the corrected one. others : list of dict, from `alternatives`.
    record : Record, on the SoC scale of the cell.
    model_error_volt : typical error of the calibrating cells' own models, `Correction` [V].

    Returns
    -------
    half_volt : (n,) [V]; NaN without alternatives.
    """
    rows = len(record.test_time_second)
    if len(others) < 2:
        return np.full(rows, np.nan)
    volt = _volt(model, record)
    square = np.mean([(_volt(other, record) - volt) ** 2 for other in others], axis=0)
    quantile = stdtrit(len(others) - 1, 0.5 + LEVEL / 2)
    return quantile * np.sqrt(square + np.nan_to_num(model_error_volt) ** 2)


def _volt(model, record):
    columns = (record.test_time_second, record.current_ampere, record.soc, record.celsius)
    return simulate_model(model, None, *columns, kind=record.kind).voltage_volt
