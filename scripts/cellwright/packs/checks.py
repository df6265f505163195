"""A group's record held against itself and against its wiring, before anything is scored with it.

Branch currents of members in parallel must add up to the total, and voltages of cells in series to
the pack's. What is left over tells a sensor that is turned, silent, in another unit, off in gain or
offset; a sum that is exact tells that one reading was computed from the others. Which channel
belongs to which member the cells' models tell: `swapped`.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from cellwright.numerics.noise import least_digit
from cellwright.numerics.statistics import (
    parameter_covariance,
    rms,
    standard_deviations,
    white_noise_of,
)
from cellwright.packs.wiring import cells_of
from cellwright.records.channels import BRANCH_CURRENT, CELL_VOLTAGE
from cellwright.refusal import Refusal

SENSOR_CLASS = 0.002  # of a reading: what two good sensors may differ by without a word
SIGMAS = 5.0  # some ten checks a record, thousands of records: no false alarm by chance
CONTRADICTION = 0.05  # of the total: a sum that misses it by more is no measurement of branches
SILENT = 0.01  # of a member's share of the total
SWAP_SHARE = 0.02  # of a member's share: a smaller gain by swapping may be the models' error
SWAP_RATIO = 0.5  # error after the swap over the error before
UNITS = {-1.0: "its sign is turned", 1000.0: "it reads in mA what is taken as A"}
UNITS |= {0.001: "it reads in A what is taken as mA"}
BEYOND_CALIBRATION = "outside the calibration"  # so begins the note of such a model


class Finding(NamedTuple):
    """One check of a record.

    check : its name. branch : number of the member or cell, None where it is of all.
    value, std, limit : what was found, its standard deviation, and the value up to which nothing
        is said, in `unit`; NaN where there is none.
    found : whether something is wrong or must be known by who reads the scores.
    sentence : for the report, also where the check could not tell.
    """

    check: str
    branch: int | None = None
    value: float = np.nan
    std: float = np.nan
    limit: float = np.nan
    unit: str = ""
    found: bool = False
    sentence: str = ""


def channel_findings(record, wiring):
    """Findings on the channels of a group's record by themselves.

    1. Members in parallel: a branch that reads nothing; one sensor whose sign or unit explains what
    the sum leaves over; else offset and gain of the sum, on the steady rows, with errors that know
    of correlated left-overs; whether one reading was computed from the others. 2. Members in
    series: each branch current against the total, and the sum of all cell voltages against the
    pack's.

    Parameters
    ----------
    record : Record of a group. wiring : Wiring of the group.

    Returns
    -------
    findings : list of Finding; empty where nothing was logged beside the total.
    """
    if wiring.connection == "series":
        findings = [*_series_currents(record), *_series_voltages(record, wiring)]
    elif record.member_current_ampere is None:
        findings = []
    else:
        findings = _parallel(record.member_current_ampere, record.current_ampere)
    said = [f"{record.test}: {one.sentence}" if one.sentence else "" for one in findings]
    return [one._replace(sentence=text) for one, text in zip(findings, said, strict=True)]


def refuse_contradiction(record, wiring):
    """Refuse a record whose branch currents miss the total by so much that they measure nothing.

    Parameters
    ----------
    record : Record of a group. wiring : Wiring of the group.

    Raises
    ------
    Refusal : what `channel_findings` say of it, where the sum misses the total by 5 % of it beside
        a constant, which is an offset and leaves the course of the currents known.
    """
    currents, total = record.branch_current_ampere, record.current_ampere
    if wiring.connection == "series" or currents is None:
        return
    missed, size = np.nansum(currents, axis=1) - total, rms(total)
    left = rms(missed - np.median(missed))
    if left > CONTRADICTION * size:
        said = [found.sentence for found in channel_findings(record, wiring) if found.found]
        sums = f"its branch currents miss the total by {left:.3g} A RMS, of {size:.3g} A in all"
        raise Refusal("; ".join([f"{record.test}: {sums}", *said]))


def beyond_calibration(models):
    """What bias-corrected models (dicts) of a group's cells say of lying beyond their calibration.

    A list of sentences with the cells' names.
    """
    return [
        f"{model['cell']}: {note}"
        for model in models
        for note in model.get("notes", ())
        if note.startswith(BEYOND_CALIBRATION)
    ]


def _parallel(currents, total):
    logged = np.isfinite(currents).any(axis=0)
    rows = np.isfinite(currents[:, logged]).all(axis=1) & np.isfinite(total)
    if rows.sum() < 10 or not rms(total[rows]) > 0:
        return [Finding("sum", sentence="too few rows with a current to add up the branches")]
    currents, total = currents[rows], total[rows]
    if not logged.all():
        return [_partly_logged(currents, total, logged)]
    left = currents.sum(axis=1) - total
    broken = _wrong_sensor(currents, total, left) or list(_silent(currents, total))
    if broken:
        return broken
    steady = _steady(total)
    sums = _sum_line(currents[steady], total[steady], left[steady])
    return [*sums, _dependent(currents, total, left)]


def _partly_logged(currents, total, logged):
    """Members without a channel: do the others carry the whole total by themselves?"""
    silent = [int(k) + 1 for k in np.flatnonzero(~logged)]
    names, limit = " and ".join(map(str, silent)), SILENT / len(logged)
    share = rms(currents[:, logged].sum(axis=1) - total) / rms(total)
    if share > limit * len(silent):
        text = f"the current of branch {names} was not logged, so no sum can check the sensors"
        return Finding("sum", sentence=text)
    text = (
        f"the logged branches add up to the total without branch {names} (all but {share:.2%}): "
        f"branch {names} of groups.tsv carries no current, as if it were not connected"
    )
    return Finding("absent", silent[0], share, np.nan, limit, "of the total", True, text)


def _silent(currents, total):
    """Branches that read nothing while the group is loaded."""
    share = rms(total) / currents.shape[1]
    for k in range(currents.shape[1]):
        size = rms(currents[:, k]) / share
        if size > SILENT:
            continue
        others = np.delete(currents, k, axis=1).sum(axis=1) - total
        alone = rms(others) <= SILENT * rms(total)
        why = f"the others miss the total by {rms(others):.3g} A RMS, so its sensor is dead"
        if alone:
            why = "the others add up to the total, so it is open or its cell is missing"
        text = f"branch {k + 1} reads {size:.2%} of an equal share of the total; {why}"
        check = "absent" if alone else "silent"
        yield Finding(check, k + 1, size, np.nan, SILENT, "of its share", True, text)


def _wrong_sensor(currents, total, left):
    """The one branch whose sign or unit explains nine tenths of what the sum leaves over."""
    if rms(left) <= CONTRADICTION * rms(total):
        return []
    for k, (factor, words) in product(range(currents.shape[1]), UNITS.items()):
        rest = left - (1.0 - 1.0 / factor) * currents[:, k]
        if rms(rest) < 0.1 * rms(left):
            text = f"branch {k + 1} alone explains why the sum misses the total: {words}"
            return [Finding("unit", k + 1, factor, unit="times", found=True, sentence=text)]
    return []


def _steady(total):
    """Rows (n,) between which the total hardly moves; all where there are few of them.

    Where it steps, sensors that are read one after the other disagree for a sample.
    """
    change = np.abs(np.diff(total, prepend=total[0], append=total[-1]))
    steady = np.maximum(change[:-1], change[1:]) <= 0.01 * np.abs(total).max()
    return steady if steady.sum() >= 20 else np.ones(len(total), bool)


def _line(regressor, left):
    """Offset and slope (2,) of what is left over, and their deviations (2,).

    The slope is NaN where the regressor does not move.
    """
    # Of a regressor that hardly moves the slope would be a quotient of two noises.
    moves = np.ptp(regressor) > 0.05 * np.abs(regressor).max()
    columns = np.column_stack([np.ones(len(left)), regressor])[:, : 1 + moves]
    return [np.append(part, [np.nan] * (2 - len(part))) for part in _fitted(columns, left)]


def _fitted(columns, left):
    """Coefficients (p,) of what is left over, and deviations that know of correlated errors."""
    values, *_ = np.linalg.lstsq(columns, left, rcond=None)
    error = left - columns @ values
    gram, power = columns.T @ columns, error @ error
    cover = parameter_covariance(gram, power, len(left), sensitivity=columns.T, residual=error)
    return values, standard_deviations(cover)


def _off(check, branch, value, std, limit, unit, words):
    """Finding on a value that is off where it is beyond its limit, and surely so."""
    off = bool(abs(value) > max(SIGMAS * std, limit))
    return Finding(check, branch, value, std, limit, unit, off, words if off else "")


def _offset_and_gain(what, branch, line, limit_ampere, words):
    """Findings on offset and gain of a current, by the line of `_line`; `words` take the values."""
    (offset, gain), (offset_std, gain_std) = line
    texts = words[0].format(offset), words[1].format(gain)
    return (
        _off(f"{what}_offset", branch, offset, offset_std, limit_ampere, "A", texts[0]),
        _off(f"{what}_gain", branch, gain, gain_std, SENSOR_CLASS, "1", texts[1]),
    )


def _sum_line(currents, total, left):
    """Offset and gain of the sum, and the branch whose gain it is where that can be told."""
    members = currents.shape[1]
    words = (
        "the branch currents add up to {:+.3g} A more than the total",
        "the branch currents add up to {:+.2%} more than the total; one branch reads wrong or "
        "several, which the record does not show",
    )
    limit = SENSOR_CLASS * rms(total) / members * np.sqrt(members)
    offset, finding = _offset_and_gain("sum", None, _line(total, left), limit, words)
    yield offset
    branch = _guilty(currents, left) if finding.found else None
    if branch is not None:
        # What is left over is slope · reading: reading = (1 + gain) · truth gives the gain.
        slope, slope_std = (pair[1] for pair in _line(currents[:, branch], left))
        gain, std = 1.0 / (1.0 - slope) - 1.0, slope_std / (1.0 - slope) ** 2
        text = f"branch {branch + 1} reads {gain:+.2%} ± {std:.2%} off"
        finding = finding._replace(branch=branch + 1, value=gain, std=std, sentence=text)
    yield finding


def _guilty(currents, left):
    """Index of the branch whose gain alone explains the left-over, None where that is not clear.

    Clear: beside its gain no other one is wanted (none beyond three of its deviations), while
    beside the gain of each other branch at least one is (beyond five).
    """
    wanted = [_wanted_beside(k, currents, left) for k in range(currents.shape[1])]
    best = int(np.argmin(wanted))
    clear = wanted[best] < 3.0 and min(np.delete(wanted, best)) > SIGMAS
    return best if clear else None


def _wanted_beside(k, currents, left):
    """Largest further gain beside that of branch k, in its deviations."""
    sizes = []
    for j in (j for j in range(currents.shape[1]) if j != k):
        columns = np.column_stack([np.ones(len(left)), currents[:, [k, j]]])
        values, stds = _fitted(columns, left)
        sizes.append(abs(values[2]) / stds[2])
    return max(sizes)


def _dependent(currents, total, left):
    """Whether the sum is exact, so that one branch was computed from the total and the others."""
    members, largest = currents.shape[1], float(np.abs(left).max())
    digit = max(map(least_digit, currents.T))
    exact = largest <= 1e-9 * np.abs(total).max()
    # Readings that were computed miss their sum by half a digit each, measured ones by noise too.
    rounded = largest <= 0.5 * (members + 1) * digit
    noise = np.sqrt(sum(white_noise_of(column) ** 2 for column in currents.T))
    if not (exact or (rounded and white_noise_of(left) < 0.3 * noise)):
        return Finding("dependent", value=largest, unit="A")
    same = "the errors of the two branches are the same number"
    many = f"only {members - 1} of {members} branch errors are measured"
    text = (
        "the branch currents add up to the total exactly: one of them was computed "
        f"from the others, and {same if members == 2 else many}"
    )
    return Finding("dependent", value=largest, unit="A", found=True, sentence=text)


def _series_currents(record):
    """Each branch current of members in series against the total: they are one current."""
    currents, total = record.member_current_ampere, record.current_ampere
    for k in range(0 if currents is None else currents.shape[1]):
        rows = np.isfinite(currents[:, k]) & np.isfinite(total)
        if rows.sum() < 10 or not rms(total[rows]) > 0:
            continue
        one, whole = currents[rows, k], total[rows]
        steady, said = _steady(whole), f"the current logged at member {k + 1} of the series is"
        words = f"{said} {{:+.3g}} A off the pack's", f"{said} {{:+.2%}} off the pack's"
        line = _line(whole[steady], (one - whole)[steady])
        yield from _offset_and_gain("current", k + 1, line, SENSOR_CLASS * rms(whole), words)


def _series_voltages(record, wiring):
    """The sum of all cell voltages of members in series against the pack's, and its contacts."""
    cells, pack = record.cell_voltage_volt, record.voltage_volt
    if cells is None or cells.shape[1] != len(wiring.members):
        return
    missing = [str(k + 1) for k in np.flatnonzero(~np.isfinite(cells).any(axis=0))]
    if missing:
        text = f"the voltage of cell {', '.join(missing)} was not logged, so the sum is not checked"
        yield Finding("voltage_sum", sentence=text)
        return
    rows = np.isfinite(cells).all(axis=1) & np.isfinite(pack)
    steady = np.flatnonzero(rows)[_steady(record.current_ampere[rows])]
    left = pack[steady] - cells[steady].sum(axis=1)
    (offset, ohm), (offset_std, ohm_std) = _line(record.current_ampere[steady], left)
    text = f"the pack reads {offset:+.3g} V more than its cells add up to"
    limit = SENSOR_CLASS * rms(pack[steady])
    yield _off("voltage_sum", None, offset, offset_std, limit, "V", text)
    # A stated contact is an estimate, of which a fifth is passed over; none is below zero.
    stated = sum(wiring.contact_ohm)
    limit = max(SIGMAS * ohm_std, 0.2 * stated)
    off = bool(ohm < -SIGMAS * ohm_std or (stated and abs(ohm - stated) > limit))
    text = (
        f"the contacts between the cells measure {1e3 * ohm:.3g} ± "
        f"{1e3 * ohm_std:.2g} mΩ together; groups.tsv states {1e3 * stated:.3g} mΩ"
    )
    yield Finding("contacts", None, ohm, ohm_std, stated, "Ω", off, text if off else "")


def swapped_channels(series, wiring, test):
    """Swapped branch currents of members in parallel, swapped voltages of cells: `swapped`.

    Parameters
    ----------
    series : dict of (n,) columns, measured ones beside simulated_<channel> of the same.
    wiring : Wiring of the group. test : name, for the sentences.

    Returns
    -------
    findings : list of Finding, empty where nothing was simulated.
    """
    total, found = rms(series["current_ampere"]), []
    if wiring.connection == "parallel":
        members = len(wiring.members)
        pair = _both(series, BRANCH_CURRENT, members)
        found += swapped(*pair, total / members, test=test) if pair else []
    cells = len(cells_of(wiring))
    pair = _both(series, CELL_VOLTAGE, cells)
    if pair:
        # What a swap must change a cell's voltage by: a share of what the load changes it by.
        moved = rms(pair[0] - pair[0].mean(axis=0))
        found += swapped(*pair, moved, test=test, what="cell")
    return found


def _both(series, channel, count):
    """Measured and simulated readings (n, count) of a channel, None where one is lacking."""
    names = [channel.format(number) for number in range(1, count + 1)]
    if not all(name in series and f"simulated_{name}" in series for name in names):
        return None
    kinds = (names, [f"simulated_{name}" for name in names])
    return [np.column_stack([series[name] for name in kind]) for kind in kinds]


def swapped(measured, simulated, share, *, test, what="branch", numbers=None, blocks=20):
    """Channels whose readings fit the models of other members clearly better than their own's.

    1. The assignment of readings to members with the least squared error (Hungarian method). 2. Of
    each circle of members that it turns: the error must fall to half or less, by more than 2 % of a
    member's share of the total; and over twenty blocks of the record what the swap makes worse in
    some may be no more than a tenth of what it betters in the others.

    Parameters
    ----------
    measured, simulated : (n, members), of the same unit; the simulated ones from the members' own
        models in the wiring as the sheet states it.
    share : root mean square of a member's share of the total, in that unit.
    test : name, for the sentence. what : "branch" or "cell". numbers : (members,) of those that
        were logged; None: 1, 2, …. blocks : of the record.

    Returns
    -------
    findings : list of Finding, one a circle; members too alike for their models are not told apart.

    Source: H. W. Kuhn, The Hungarian method for the assignment problem, Naval Research Logistics
    Quarterly 2 (1955) 83.
    """
    rows = np.isfinite(measured).all(axis=1) & np.isfinite(simulated).all(axis=1)
    measured, simulated = measured[rows], simulated[rows]
    if len(measured) < blocks or not share > 0:
        return []
    # Σ(measured − simulated)² of every pair, without a pass over the record for each.
    cost = np.square(measured).sum(axis=0)[:, None] + np.square(simulated).sum(axis=0)
    cost -= 2.0 * measured.T @ simulated
    # Who is read where must be worth more than what the models of two like cells do not tell.
    cost += len(measured) * (SWAP_SHARE * share) ** 2 * (1.0 - np.eye(len(cost)))
    member_of = linear_sum_assignment(cost)[1]
    names = range(1, len(cost) + 1) if numbers is None else numbers
    found = []
    for circle in _circles(member_of):
        own = np.square(measured[:, circle] - simulated[:, circle]).sum(axis=1)
        other = np.square(measured[:, circle] - simulated[:, member_of[circle]]).sum(axis=1)
        before, after = (np.sqrt(error.mean() / len(circle)) for error in (own, other))
        gains = np.array([part.sum() for part in np.array_split(own - other, blocks)])
        steady = -gains[gains < 0].sum() <= 0.1 * gains[gains > 0].sum()
        if steady and after <= SWAP_RATIO * before and before - after > SWAP_SHARE * share:
            named = [names[k] for k in circle], [names[member_of[k]] for k in circle]
            found.append(_swap(*named, before / share, after / share, test, what))
    return found


def _circles(member_of):
    """Circles of the permutation, longer than one: lists of indices."""
    seen, circles = set(), []
    for first in range(len(member_of)):
        circle, k = [], first
        while k not in seen:
            seen.add(k)
            circle.append(k)
            k = int(member_of[k])
        circles += [circle] if len(circle) > 1 else []
    return circles


def _swap(read, fitting, before, after, test, what):
    of = "its share" if what == "branch" else "its change under load"
    pairs = zip(read, fitting, strict=True)
    fits = ", ".join(f"{what} {k} fits the model of {what} {other}" for k, other in pairs)
    text = (
        f"{test}: swapped channels? What was logged as {fits}: exchanged, the error is {after:.1%} "
        f"of {of} instead of {before:.1%}. They were used as logged; check groups.tsv or the wiring"
    )
    limit = SWAP_RATIO * before
    return Finding("swapped", int(read[0]), after, np.nan, limit, f"of {of}", True, text)
