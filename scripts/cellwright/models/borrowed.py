"""The model of a cell without pulses: its type's reference, corrected by what the cell shows."""

from typing import NamedTuple

import numpy as np

from cellwright.models.basis import REFERENCE_CELSIUS, reference_of
from cellwright.models.bias import biased_model, calibrate, peak_shift, scaled_reference
from cellwright.models.changed import fast_and_slow
from cellwright.models.lookup import circuit_at, member_of, open_circuit_volt
from cellwright.refusal import Refusal

SAME_RATE = 0.1
KNOTS = np.linspace(0.1, 0.9, 9)


class Shown(NamedTuple):
    """What a cell shows: its model (None for the one that has none), IC peaks, load resistance.

    peaks : list of dict, rows of stage `ica`. onset_ohm : resistance at the onset of its discharges
    from full, delay [s] → [ohm]; empty where none was measured.
    """

    cell: str
    marked: bool
    capacity_ampere_hour: float
    model: dict | None
    peaks: list
    onset_ohm: dict


def borrowed_model(own, peers):
    """Model from the reference cell of the type, by the shift of IC peaks or by scaling.

    1. The reference is the first marked cell, else the largest. 2. Where enough other cells have
    both IC peaks at the same rate and a model with the reference's chosen member, the bias
    functions (thesis eq. 4.3, 4.5) are calibrated on them and predict this cell. 3. Else the
    reference is scaled: capacity by the cell's own, resistances by the ratio of what both show at
    the onset of a discharge from full.

    Parameters
    ----------
    own : Shown, with model None.
    peers : list of Shown, with models.

    Returns
    -------
    model : dict of schema cellwright-model/2, kind "bias" or "scaled"; `notes` say why.

    Raises
    ------
    Refusal
        No cell of the type has a model.
    """
    if not peers:
        raise Refusal("no cell of the same chemistry and rating has a model to borrow")
    reference = reference_of(peers, capacity=lambda peer: peer.capacity_ampere_hour)
    others = [peer for peer in peers if peer is not reference]
    try:
        return _biased(own, reference, others)
    except Refusal as refusal:
        ratio, how = _resistance_ratio(own, reference)
        model = scaled_reference(
            reference.model,
            cell=own.cell,
            capacity=own.capacity_ampere_hour,
            resistance_ratio=ratio,
        )
        return model | {"notes": [*model["notes"], how, f"not by IC peaks: {refusal}"]}


def _biased(own, reference, others):
    main, mean = _shift(reference, own)
    base, shifts, changes = _courses(reference.model, reference.model["chosen"]), [], []
    for peer in others:
        try:
            shift = _shift(reference, peer)
            courses = _courses(peer.model, reference.model["chosen"])
        except Refusal:
            continue
        shifts.append(shift)
        changes.append([b - a for a, b in zip(base, courses, strict=True)])
    r0, rp, ocv = (np.array([change[k] for change in changes]) for k in range(3))
    mains, means = np.array(shifts).reshape(-1, 2).T
    calibration = calibrate(mains, means, KNOTS, r0, rp, ocv)
    model = biased_model(
        reference.model,
        calibration,
        cell=own.cell,
        main_shift_volt=main,
        mean_shift_volt=mean,
        capacity=own.capacity_ampere_hour,
    )
    left_out = (
        f"leave-one-cell-out errors: R0 {1e3 * calibration.r0_left_out_ohm:.2f} mΩ, polarisation "
        f"{1e3 * calibration.polarisation_left_out_ohm:.2f} mΩ, OCV "
        f"{1e3 * calibration.ocv_left_out_volt:.1f} mV"
    )
    return model | {"notes": [*model["notes"], left_out]}


def _shift(reference, cell):
    """Main and mean shift of a cell's IC peaks from the reference's, at the same rate."""
    rates = {row["c_rate"] for row in reference.peaks}
    for rate in sorted(rates):
        theirs = [r for r in cell.peaks if abs(r["c_rate"] / rate - 1) < SAME_RATE]
        ours = [r for r in reference.peaks if r["c_rate"] == rate]
        if theirs:
            return peak_shift(
                [r["voltage_volt"] for r in ours],
                [r["height_ampere_hour_per_volt"] for r in ours],
                [r["voltage_volt"] for r in theirs],
            )
    raise Refusal(f"{cell.cell} and {reference.cell} have no IC peaks at the same rate")


def _courses(model, member):
    """Fast and slow resistance and OCV over the knots at 25 °C, of the same member of all cells."""
    found = circuit_at(member_of(model, member)["conditions"], KNOTS, REFERENCE_CELSIUS)
    fast, slow = fast_and_slow([branch.parameters for branch in found.circuit])
    return fast, slow, open_circuit_volt(model, found, REFERENCE_CELSIUS)


def _resistance_ratio(own, reference):
    """Ratio at the longest delay that both cells have; one where they have none in common."""
    common = sorted(set(own.onset_ohm) & set(reference.onset_ohm))
    if not common:
        return 1.0, "its resistance is not known: taken as the reference's"
    delay = common[-1]
    ratio = own.onset_ohm[delay] / reference.onset_ohm[delay]
    return ratio, f"resistance by the onset of its discharges from full ({delay:g} s)"
