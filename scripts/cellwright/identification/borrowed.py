"""Models of cells without pulses: the reference cell's, corrected by what the cell shows.

Source: thesis 4.5, eq. 4.2–4.6. Its products a2·a3, a2·a4, −a2·a5 (and c2·c4 …) are merged, since
only the products can be identified: f = s·ΔV² + ΔV·(k0 + k1·z + k2·z²).
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import circuit_at, member_of, open_circuit_volt
from cellwright.identification.columns import FAST_SECOND
from cellwright.numerics.statistics import rms
from cellwright.records.basis import REFERENCE_CELSIUS, reference_of
from cellwright.refusal import Refusal

LEAST = 0.1  # of the reference's resistance: no cell of its type has less
RESISTANCES = ("r_ohm", "r_charge_ohm", "r_discharge_ohm")


def fast_and_slow(elements):
    """Sums of the resistances that act within `FAST_SECOND` and of the slower ones (k,) [ohm].

    Which part of the fast resistance is ohmic, charge transfer or a short time constant depends on
    the sampling and on the member; their sum compares between cells.

    Parameters
    ----------
    elements : dicts of parameters over SoC; those without r_ohm count nothing, one without
        tau_second acts at once.

    Returns
    -------
    fast_ohm, slow_ohm : (k,) at small currents [ohm].
    """
    pairs = [
        (
            np.asarray(element["r_ohm"], float),
            np.asarray(element.get("tau_second", 0.0)) <= FAST_SECOND,
        )
        for element in elements
        if "r_ohm" in element
    ]
    return tuple(
        sum(np.where(fast == is_fast, r, 0.0) for r, fast in pairs) for is_fast in (True, False)
    )


def ratio_of(resistance, more):
    """Factor on a resistance that adds a difference to it [1], at least `LEAST`.

    Parameters
    ----------
    resistance, more : (k,) [ohm], or more a scalar.
    """
    ratio = np.divide(
        resistance + more, resistance, out=np.ones_like(resistance), where=resistance > 0
    )
    return np.maximum(ratio, LEAST)


def changed(reference, change, *, cell, capacity, kind, note):
    """Model of a cell as its type's reference with other resistances, OCV and capacity.

    Parameters
    ----------
    reference : model dict of schema cellwright-model/2.
    change : function (condition) → ((factor on fast, on slow resistance), addition to the OCV [V]),
        each a scalar or one value per knot.
    cell : id of the new cell.
    capacity : its capacity [Ah].
    kind : of the model, "bias" or "scaled". note : sentence for the report.

    Returns
    -------
    model : dict.
    """
    size = capacity / reference["capacity_ampere_hour"]

    def entry_of(entry):
        (fast, slow), ocv = change(entry)
        shift = np.asarray(entry.get("ocv_shift_volt", np.zeros(len(entry["soc"]))))
        return entry | {
            "r0_ohm": (fast * np.asarray(entry["r0_ohm"])).tolist(),
            "branches": [_branch(branch, fast, slow, size) for branch in entry["branches"]],
            "ocv_shift_volt": (shift + ocv).tolist(),
        }

    members = [
        member | {"conditions": [entry_of(entry) for entry in member["conditions"]]}
        for member in reference["members"]
    ]
    cell_fields = {
        "cell": cell,
        "capacity_ampere_hour": float(capacity),
        "kind": kind,
        "members": members,
    }
    # What was left out of the reference's fit says nothing of this cell.
    rest = {name: value for name, value in reference.items() if name != "left_out"}
    return {**rest, **cell_fields, "notes": [note]}


def _branch(branch, fast, slow, size):
    # ASSUME: Cells of one type have the same hysteresis, kinetics and diffusion over SoC, whatever
    # their capacity: charge constants go with the capacity, the lead of a surface with its inverse.
    at_once = np.asarray(branch.get("tau_second", 0.0)) <= FAST_SECOND
    factors = dict.fromkeys(RESISTANCES, np.where(at_once, fast, slow))
    factors |= {"soc_per_ampere": 1.0 / size, "charge_ampere_hour": size}
    scaled = {n: (np.asarray(branch[n]) * f).tolist() for n, f in factors.items() if n in branch}
    return branch | scaled


class Calibration(NamedTuple):
    """Coefficients of the bias functions and their leave-one-cell-out errors.

    r0, ocv : (4,) [ohm/V², ohm/V ×3], [1/V, 1 ×3]; polarisation : [ohm/V]; errors RMS. R0 stands
    for all that acts within seconds, polarisation for the rest, see `fast_and_slow`.
    """

    r0: np.ndarray
    polarisation: float
    ocv: np.ndarray
    r0_left_out_ohm: float
    polarisation_left_out_ohm: float
    ocv_left_out_volt: float
    cells: int


def match_peaks(reference_volt, target_volt, *, reach_volt=0.25):
    """Pair IC peaks of two cells: by order where both show as many, else mutual nearest ones.

    Parameters
    ----------
    reference_volt, target_volt : (p,), (q,) ascending peak voltages at the same rate [V].
    reach_volt : peaks further apart than this are not the same peak [V].

    Returns
    -------
    pairs : (m, 2) indices into reference and target.

    Raises
    ------
    Refusal : nothing matches.
    """
    distance = np.abs(np.subtract.outer(reference_volt, target_volt))
    if not distance.size:
        raise Refusal("a cell shows no IC peak: its shift from the reference is not known")
    rows = np.arange(len(reference_volt))
    nearest = distance.argmin(axis=1)
    mutual = distance.argmin(axis=0)[nearest] == rows
    if distance.shape[0] == distance.shape[1]:
        nearest, mutual = rows, np.full(len(rows), True)
    pairs = np.column_stack([rows, nearest])[mutual & (distance[rows, nearest] <= reach_volt)]
    if not len(pairs):
        raise Refusal(f"no IC peak of the cell lies within {reach_volt:g} V of a reference peak")
    return pairs


def peak_shift(reference_volt, reference_height, target_volt, *, reach_volt=0.25):
    """Shift of the reference's highest matched peak, and mean shift of all matched peaks.

    Parameters
    ----------
    reference_volt, reference_height, target_volt : peaks as in `match_peaks`; heights in any unit.
    reach_volt : see `match_peaks`.

    Returns
    -------
    main_volt, mean_volt : target minus reference [V].
    """
    reference_volt, target_volt = np.asarray(reference_volt), np.asarray(target_volt)
    pairs = match_peaks(reference_volt, target_volt, reach_volt=reach_volt)
    shifts = target_volt[pairs[:, 1]] - reference_volt[pairs[:, 0]]
    return float(shifts[np.argmax(np.asarray(reference_height)[pairs[:, 0]])]), float(shifts.mean())


def quadratic_bias(shift_volt, soc, coefficients):
    """Bias function of R0 and OCV: s·ΔV² + ΔV·(k0 + k1·z + k2·z²).

    Parameters
    ----------
    shift_volt : scalar [V].
    soc : scalar or (k,) [1].
    coefficients : (4,) s, k0, k1, k2.

    Returns
    -------
    bias : shape of soc, unit of the coefficients times volts.

    Source: thesis (4.3), (4.5). Erratum: the worked example (4.6) needs a2 = 0.17 and the factor
    ΔV in the second term; table 4.5 prints 1.7.
    """
    return _columns(shift_volt, np.asarray(soc, float)) @ np.asarray(coefficients)


def calibrate(main_shift_volt, mean_shift_volt, soc, r0_change, rp_change, ocv_change):
    """Fit the bias functions on cells that have both pulses and a charge with IC peaks.

    Parameters
    ----------
    main_shift_volt, mean_shift_volt : (cells,) from `peak_shift` [V].
    soc : (k,) common SoC of the changes [1].
    r0_change : fast resistance, rp_change : slow one, ocv_change : OCV;
        (cells, k) cell minus reference [ohm], [ohm], [V].

    Returns
    -------
    calibration : Calibration.

    Raises
    ------
    Refusal : fewer than three cells (two would be met exactly, one left out could not be
        predicted), fewer than three SoC, or all shifts alike.
    """
    # ASSUME: A shift of the IC peaks tells resistance and OCV of a cell by the thesis' eq. 4.3.
    main, mean = np.asarray(main_shift_volt, float), np.asarray(mean_shift_volt, float)
    if len(main) < 3:
        raise Refusal(
            f"{len(main)} cell(s) beside the reference have pulses and IC peaks; 3 needed"
        )
    stacked = np.array([_columns(shift, np.asarray(soc, float)) for shift in main])
    if np.linalg.matrix_rank(stacked[1:].reshape(-1, 4), rtol=1e-6) < 4:
        raise Refusal("the peak shifts of the calibrating cells, or their SoC, are too much alike")
    flat = mean[:, None, None] * np.ones((1, len(soc), 1))
    r0, r0_error = _fitted(stacked, np.asarray(r0_change, float))
    rp, rp_error = _fitted(flat, np.asarray(rp_change, float))
    ocv, ocv_error = _fitted(stacked, np.asarray(ocv_change, float))
    return Calibration(r0, float(rp[0]), ocv, r0_error, rp_error, ocv_error, len(main))


def biased_model(reference, calibration, *, cell, main_shift_volt, mean_shift_volt, capacity):
    """Model of a cell from the reference's, corrected by the shift of its IC peaks.

    Parameters
    ----------
    reference : model dict of schema cellwright-model/2.
    calibration : Calibration.
    cell : id of the new cell.
    main_shift_volt, mean_shift_volt : its shifts from the reference, `peak_shift` [V].
    capacity : its capacity [Ah].

    Returns
    -------
    model : dict, kind "bias". Of R0 and all branches, fast and slow resistances are scaled to what
        the bias functions give for their sums (`fast_and_slow`), at least to a tenth of the
        reference's. All else as in `scaled_reference`.
    """

    def change(entry):
        soc = np.asarray(entry["soc"])
        fast, slow = fast_and_slow([{"r_ohm": entry["r0_ohm"]}, *entry["branches"]])
        fast_change = quadratic_bias(main_shift_volt, soc, calibration.r0)
        ratios = (
            ratio_of(fast, fast_change),
            ratio_of(slow, calibration.polarisation * mean_shift_volt),
        )
        return ratios, quadratic_bias(main_shift_volt, soc, calibration.ocv)

    note = (
        f"bias-corrected from {reference['cell']}: IC peaks shifted by {1e3 * main_shift_volt:.1f} "
        f"mV, calibrated on {calibration.cells} cells"
    )
    return changed(reference, change, cell=cell, capacity=capacity, kind="bias", note=note)


def scaled_reference(reference, *, cell, capacity, resistance_ratio):
    """Model of a cell as the reference with its own capacity and all resistances scaled.

    Parameters
    ----------
    reference : model dict of schema cellwright-model/2.
    cell : id of the new cell.
    capacity : its capacity [Ah].
    resistance_ratio : its resistance over the reference's [1].

    Returns
    -------
    model : dict, kind "scaled". Time constants, the scale of the kinetics and the size of the
        hysteresis stay; its charge goes with the capacity, the lead of diffusion with its inverse.

    Raises
    ------
    Refusal : ratio or capacity not positive.
    """
    # ASSUME: A cell without its own pulses has the reference's OCV over SoC and its resistances
    # times one factor.
    if not (resistance_ratio > 0 and capacity > 0):
        raise Refusal(f"capacity {capacity} Ah or resistance ratio {resistance_ratio} not positive")

    def change(entry):
        return (resistance_ratio, resistance_ratio), np.zeros(len(entry["soc"]))

    note = f"scaled from {reference['cell']}: resistances times {resistance_ratio:.3f}"
    return changed(reference, change, cell=cell, capacity=capacity, kind="scaled", note=note)


def _columns(shift, soc):
    ones = np.ones_like(soc)
    return np.stack([shift**2 * ones, shift * ones, shift * soc, shift * soc**2], axis=-1)


def _fitted(columns, change):
    """Least squares over all cells, and the RMS error of each cell predicted from the others."""
    width, cells = columns.shape[-1], np.arange(len(change))
    errors = []
    for cell in cells:
        others = cells != cell
        part = np.linalg.lstsq(columns[others].reshape(-1, width), change[others].ravel())[0]
        errors.append(columns[cell] @ part - change[cell])
    fit = np.linalg.lstsq(columns.reshape(-1, width), change.ravel())[0]
    return fit, rms(errors)


SAME_RATE = 0.1
KNOTS = np.linspace(0.1, 0.9, 9)


class Shown(NamedTuple):
    """Measurements of a cell that a borrowed model uses: model or None, IC peaks, load resistance.

    peaks : list of dict, rows of stage `ica`. onset_ohm : resistance at the onset of its discharges
    from full, delay [s] → [ohm]; empty where none was measured.
    """

    cell: str
    marked: bool
    capacity_ampere_hour: float
    model: dict | None
    peaks: list
    onset_ohm: dict


def borrowed_model(cell, peers):
    """Model from the reference cell of the type, by the shift of IC peaks or by scaling.

    1. The reference is the first marked cell, else the largest. 2. Where enough other cells have
    both IC peaks at the same rate and a model with the reference's chosen member, the bias
    functions (thesis eq. 4.3, 4.5) are calibrated on them and predict this cell. 3. Else the
    reference is scaled: capacity by the cell's own, resistances by the ratio of what both show at
    the onset of a discharge from full.

    Parameters
    ----------
    cell : Shown, with model None.
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
        return _biased(cell, reference, others)
    except Refusal as refusal:
        ratio, sentence = _resistance_ratio(cell, reference)
        model = scaled_reference(
            reference.model,
            cell=cell.cell,
            capacity=cell.capacity_ampere_hour,
            resistance_ratio=ratio,
        )
        return model | {"notes": [*model["notes"], sentence, f"not by IC peaks: {refusal}"]}


def _biased(cell, reference, others):
    main, mean = _shift(reference, cell)
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
        cell=cell.cell,
        main_shift_volt=main,
        mean_shift_volt=mean,
        capacity=cell.capacity_ampere_hour,
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
    sampled = circuit_at(member_of(model, member)["conditions"], KNOTS, REFERENCE_CELSIUS)
    fast, slow = fast_and_slow([branch.parameters for branch in sampled.circuit])
    return fast, slow, open_circuit_volt(model, sampled, REFERENCE_CELSIUS)


def _resistance_ratio(cell, reference):
    """Ratio of the onset resistances at the longest common delay [1], 1 without any; its source."""
    common = sorted(set(cell.onset_ohm) & set(reference.onset_ohm))
    if not common:
        return 1.0, "its resistance is not known: taken as the reference's"
    delay = common[-1]
    ratio = cell.onset_ohm[delay] / reference.onset_ohm[delay]
    return ratio, f"resistance by the onset of its discharges from full ({delay:g} s)"
