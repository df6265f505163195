"""Open-circuit voltage over SoC from the ends of rests, where a cell has no slow test.

The protocol, in steps: (1) from full, take out a portion; (2) rest, until the voltage hardly moves;
(3) repeat to the lower cut-off. Each rest is a point of the curve: what of it is still to relax is
added where two exponentials tell it.
"""

import numpy as np

from cellwright.protocols.half_cycles import columns_of
from cellwright.protocols.ocv.slow import POINTS, OcvCurve, joined, rising
from cellwright.protocols.rests import rests_of
from cellwright.refusal import Refusal
from cellwright.series.steps import follows_directly

FEWEST, SPAN = 5, 0.5  # points of a branch, and the SoC that they must span
POINT = (
    *("charge_ampere_hour", "end_volt", "relaxed_volt", "doubt_volt", "direction"),
    *("current_ampere", "rest_second", "read_ampere_hour"),
)


def rest_points(series, steps):
    """Voltage and charge at the end of each rest of ten minutes or more that follows a load.

    Before the first of them, where the cell is nearly full, a rest after a discharge counts that is
    ten times as long as its load: a pulse of seconds leaves little to relax.

    series : dict of (n,) columns of stage `clean`: test_time_second, current_ampere, voltage_volt,
        charge_ampere_hour.
    steps : series.steps.Steps.

    Returns points: dict of (rests,) columns. charge_ampere_hour : net charge of the record at its
    end [Ah]. end_volt : median of its last fiftieth [V]. relaxed_volt : where its exponentials end,
    NaN where they are not told [V]. doubt_volt : what the extrapolation may be off by, NaN where
    there is none [V]. direction : of the load before. current_ampere : of that load, positive on
    charge. rest_second : length. read_ampere_hour : what the current channel counted within the
    rest [Ah].
    """
    time, (current, voltage, charge) = series["test_time_second"], columns_of(series)
    time, unknown = np.asarray(time, float), np.full(len(time), np.nan)
    fitted = rests_of(time, current, voltage, unknown, steps, diffusion=False).rows
    chosen = [
        {name: column[k] for name, column in fitted.items()}
        for k in np.flatnonzero(fitted["chosen"])
    ]
    portions = [abs(row["current_before_ampere"]) * row["load_second"] / 3600 for row in chosen]
    # Less than 0.3 % of the charge that the record moves, before a rest, is no load.
    least = 0.003 * float(np.ptp(charge))
    rows = [_long_rest(row) for row, moved in zip(chosen, portions, strict=True) if moved >= least]
    first = min((row["start"] for row in rows), default=-np.inf)
    rows = [*_short_rests(steps, before=first), *rows]
    rows = [row | _ends(time, voltage, charge, row) for row in rows]
    return {name: np.array([row[name] for row in rows]) for name in POINT}


def _long_rest(fitted):
    """Columns of a rest with its extrapolation, where at least two exponentials are determined."""
    # One exponential ends too early: its end is no OCV. Twice the drift as in `fit_relaxation`.
    determined = fitted["exponentials"] >= 2 and np.isfinite(fitted["ocv_std_volt"])
    doubt = np.nanmax([2 * abs(fitted["drift_volt"]), fitted["ocv_std_volt"]])
    begin = fitted["start_time_second"]
    return {
        "start": begin,
        "end": begin - fitted["delay_second"] + fitted["rest_second"],
        "relaxed_volt": fitted["ocv_volt"] if determined else np.nan,
        "doubt_volt": doubt if determined else np.nan,
        "direction": fitted["direction"],
        "current_ampere": fitted["current_before_ampere"],
        "rest_second": fitted["rest_second"],
    }


def _short_rests(steps, *, before):
    """Columns of each short rest before the first long one, ten times as long as its discharge."""
    early = follows_directly(steps) & (np.asarray(steps.kind) == "rest")
    early &= (steps.end_time_second <= before) & (np.roll(steps.current_mean_ampere, 1) < 0)
    # Ten times its load: a pair of a long time constant that a pulse charged little has decayed.
    early &= steps.duration_second >= 10.0 * np.roll(steps.duration_second, 1)
    for k in np.flatnonzero(early):
        yield {
            "start": steps.start_time_second[k],
            "end": steps.end_time_second[k],
            "relaxed_volt": np.nan,
            "doubt_volt": np.nan,
            "direction": "discharge",
            "current_ampere": steps.current_mean_ampere[k - 1],
            "rest_second": steps.duration_second[k],
        }


def _ends(time, voltage, charge, row):
    """Charge [Ah] and voltage [V] at the end of a rest, and charge counted within it [Ah]."""
    inside = (time >= row["start"]) & (time <= row["end"])
    # The end is the last fiftieth, of which a slow relaxation moves no more than its noise.
    late = inside & (time >= row["end"] - 0.02 * row["rest_second"])
    within = charge[inside]
    return {
        "charge_ampere_hour": within[-1],
        # A median: the last samples show the next load where the clock of the voltage is ahead.
        "end_volt": np.median(voltage[late]),
        "read_ampere_hour": within[-1] - within[0],
    }


def ocv_of_rests(points, scale, *, lower_cutoff_volt, upper_cutoff_volt=None):
    """OCV curve through the rests of a record.

    Rests after discharge are one branch, those after charge another; a branch takes 5 points that
    span half the SoC. Within each, points are made monotone (isotonic regression) and joined by
    monotone cubics (PCHIP). Where both are there the curve is their mean. Beyond the outermost
    points it runs on straight through the last two of them, not beyond the cut-offs.

    points : of `rest_points`. scale : records.anchor.Scale.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None.

    Returns curve: OcvCurve with branches "rests"; joined_by "mean" or "single". Raises Refusal:
    too few rests, or they span too little.

    Source: PCHIP: F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238.
    """
    soc = np.linspace(0.0, 1.0, POINTS)
    rest_soc = soc_at(points, scale)
    volt = np.where(np.isnan(points["relaxed_volt"]), points["end_volt"], points["relaxed_volt"])
    after = {name: points["direction"] == name for name in ("discharge", "charge")}
    # A first row below a later rest is no rest: it shows the load after it, by a clock that is off.
    starts_full = scale.first_volt >= volt.max(initial=-np.inf) and rest_soc.max(initial=0) < 1
    full_point = {"discharge": [(1.0, scale.first_volt)] if starts_full else [], "charge": []}
    branches, moved = zip(
        *(_branch(rest_soc[r], volt[r], full_point[n], soc) for n, r in after.items()), strict=True
    )
    made = [branch is not None for branch in branches]
    if not any(made):
        raise Refusal(_too_few(rest_soc, after))
    used = np.any([rows for rows, is_made in zip(after.values(), made, strict=True) if is_made], 0)
    volts = [np.full(POINTS, np.nan) if branch is None else branch for branch in branches]
    joined_by = "mean" if all(made) else "single"
    ocv, measured = joined(soc, *volts, *branches, joined_by)
    extended = _extended(soc, ocv, measured, lower_cutoff_volt, upper_cutoff_volt)
    table = rising(extended)
    return OcvCurve(
        soc=soc,
        ocv_volt=table,
        discharge_volt=volts[0],
        charge_volt=volts[1],
        half_gap_volt=(volts[1] - volts[0]) / 2,
        capacity_ampere_hour=scale.capacity_ampere_hour,
        charge_capacity_ampere_hour=np.nan,
        closed_capacity_ampere_hour=scale.capacity_ampere_hour,
        branches="rests",
        discharge_current_ampere=_usual(points["current_ampere"][after["discharge"]]),
        charge_current_ampere=_usual(points["current_ampere"][after["charge"]]),
        joined_by=joined_by,
        step_volt=np.nan,
        measured_soc=(float(soc[measured].min()), float(soc[measured].max())),
        moved_volt=float(max(*moved, np.abs(table - extended).max())),
        note=_note(points, scale, used, joined_by, soc[measured], starts_full),
    )


def soc_at(points, scale):
    """State of charge (rests,) at the end of each rest.

    points : of `rest_points`. scale : records.anchor.Scale.
    """
    return 1 + (points["charge_ampere_hour"] - scale.full_ampere_hour) / scale.capacity_ampere_hour


def _branch(rest_soc, volt, full_point, soc):
    """Voltage of one branch at the table's SoC [V], NaN beyond it, and its largest correction [V].

    None and 0 where its rests are too few.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import isotonic_regression

    if len(rest_soc) < FEWEST or np.ptp(rest_soc) < SPAN:
        return None, 0.0
    pairs = sorted([*zip(rest_soc, volt, strict=True), *full_point])
    point_soc, at_rest = np.array(pairs).T
    monotone = isotonic_regression(at_rest).x
    places, first = np.unique(point_soc, return_index=True)
    inside = (soc >= places[0] - 0.5 / POINTS) & (soc <= places[-1] + 0.5 / POINTS)
    course = PchipInterpolator(places, monotone[first])(np.clip(soc, places[0], places[-1]))
    return np.where(inside, course, np.nan), float(np.abs(monotone - at_rest).max())


def _usual(current):
    """Median current [A]; NaN without any."""
    return float(np.median(current)) if len(current) else np.nan


# ASSUME: Beyond its outermost rests an OCV curve runs on straight, as far as the cut-offs.
def _extended(soc, ocv, measured, lower, upper):
    """OCV (n,) [V], continued with the mean slopes of its first and last 5 % of SoC."""
    measured_rows, step = np.flatnonzero(measured), POINTS // 20
    first, last = measured_rows[0], measured_rows[-1]
    ends = [(first, first + step), (last - step, last)]
    slopes = [(ocv[b] - ocv[a]) / (soc[b] - soc[a]) for a, b in ends]
    below = np.maximum(ocv[first] + slopes[0] * (soc - soc[first]), min(lower, ocv[first]))
    above = ocv[last] + slopes[1] * (soc - soc[last])
    if upper is not None:
        above = np.minimum(above, max(upper, ocv[last]))
    return np.where(soc < soc[first], below, np.where(soc > soc[last], above, ocv))


def _too_few(rest_soc, after):
    """Why no branch of the curve can be made, with what there is."""
    spans = {name: np.ptp(rest_soc[rows]) if rows.any() else 0 for name, rows in after.items()}
    counts = [f"{after[n].sum()} after {n} over {span:.0%} of the SoC" for n, span in spans.items()]
    wanted = f"{FEWEST} that span {SPAN:.0%}"
    return f"too few rests for an OCV curve: {', '.join(counts)}; wanted {wanted}"


def _note(points, scale, used, joined_by, measured_soc, starts_full):
    """Sentences on how far the rests had relaxed, which branch they are, and what is measured."""
    ahead = 1e3 * np.abs(points["relaxed_volt"] - points["end_volt"])[used]
    determined = np.isfinite(ahead)
    sentences = [f"OCV from {used.sum()} rests; {scale.start}"]
    if determined.any():
        added, doubt = ahead[determined], 1e3 * points["doubt_volt"][used][determined]
        sentences.append(
            f"what was still to relax is added ({np.median(added):.1f} mV typically, "
            f"{added.max():.1f} mV at most) and may be off by {np.median(doubt):.1f} mV typically, "
            f"{doubt.max():.1f} at most"
        )
    if not determined.all():
        sentences.append(
            f"{(~determined).sum()} are taken as measured: their exponentials are not told"
        )
    if joined_by == "single":
        side = points["direction"][used][0]
        sentences.append(
            f"all after {side}: half a hysteresis, if the cell has one, is in the curve"
        )
    if starts_full:
        sentences.append("at full the first row: how long the cell had rested is not known")
    low, high = measured_soc.min(), measured_soc.max()
    if low > 0 or high < 1:
        sentences.append(f"straight on beyond SoC {low:.3f} to {high:.3f}")
    read = points["read_ampere_hour"].sum() / scale.capacity_ampere_hour
    # Half a per cent of the capacity is as much as a counted SoC is believed.
    if abs(read) > 0.005:
        sentences.append(
            f"the current read in the rests counts {read:+.1%} of the capacity: an offset?"
        )
    return "; ".join(sentences)
