"""Which member of the family a model uses: judged by rows that took no part in the fit.

Identification chooses by blocks left out of linear fits. A finished model also mixes temperatures,
follows laws over them, and may hold a member that a search for missing effects has found; so its
members are compared once more, as they are simulated.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.circuit import member_named, size_of
from cellwright.identification.identify import ready_records
from cellwright.identification.regression import held_out
from cellwright.identification.validation import simulated
from cellwright.numerics.statistics import rms
from cellwright.records.anchor import REST_C_RATE
from cellwright.records.blocks import blocks_of_used
from cellwright.records.record import Record, records_by_temperature
from cellwright.refusal import Refusal

FOLDS = 4
SMALLEST_VOLT2 = 1e-12
NEAR = 1.1  # of rms errors that count as equal
CLEAR = 1.0  # standard errors: the one-standard-error rule
SURE = 2.0  # standard errors that are no chance: 95 %
FAR = 2.0  # times the smallest error of a temperature: no member that errs by more is chosen
UNUSABLE_VOLT = 0.1  # error from which on a model is told to be of no use where the voltage counts
MATERIAL_VOLT = 1e-3  # accuracy of a good cycler: errors that differ by less are alike


class Score(NamedTuple):
    """Mean square error of each block of a record when it was left out.

    square_volt2 : (b,) [V²]. rows : (b,) how many rows the block has.
    """

    square_volt2: np.ndarray
    rows: np.ndarray


class Choice(NamedTuple):
    """The chosen member, the rms error of every member [V], and a sentence on how clear it is.

    reasons : name of the member → why it was chosen, or why not.
    """

    name: str
    rmse_volt: dict
    words: str
    reasons: dict


def left_out(fitted, block):
    """Errors of a fitted member by block, each block predicted without its fold.

    Every fourth block is left out at once, so that blocks predicted lie between blocks fitted, as
    in use. Time constants and scales are not searched anew.

    Parameters
    ----------
    fitted : identify.Fitted.
    block : (n,) number of the block of each row of its system.

    Returns
    -------
    score : Score.

    Raises
    ------
    Refusal : fewer than two blocks: nothing can be left out.
    """
    numbers, block_index = np.unique(block, return_inverse=True)
    if len(numbers) < 2:
        raise Refusal("the data are one block: nothing can be left out to choose a model by")
    folds = min(FOLDS, len(numbers))
    error = held_out(fitted.system, fitted.solution, block_index % folds)
    rows = np.bincount(block_index)
    return Score(np.bincount(block_index, error**2) / rows, rows)


def choose(scores, *, celsius=None, fitted_volt=None, searched=()):
    """The simplest of the members that predict blocks left out of their fit equally well.

    1. No member is chosen that, simulated through the records fitted, errs far more than the best
    of the family at any temperature: more than `FAR` times, and more than `MATERIAL_VOLT` beyond.
    2. Compared is the logarithm of each block's mean square error, so that one block near empty
    does not outvote all others. Equal to the best are members whose mean difference from it, block
    by block, is less than one standard error; of these, those whose rms error over all blocks is
    within a tenth of the smallest, for what fails in one corner is not equal to what does not. The
    simplest of them is chosen.
    3. A member of `searched` was found by a search of the same records. It takes that one's
    place if it is better by two standard errors, its rms error is not larger, and it is at no
    temperature worse by more than a tenth.

    Parameters
    ----------
    scores : dict name of the member → list of Score, one a condition, of the same blocks.
    celsius : temperature of each condition, for the words [degC].
    fitted_volt : dict name of the member → (conditions,) rms error of its simulation over the
        records fitted [V]; None: not looked at.
    searched : names of the members that a search has found.

    Returns
    -------
    choice : Choice.

    Raises
    ------
    Refusal : no member, or members that were not scored on the same blocks.

    Source: the one-standard-error rule of L. Breiman et al., Classification and Regression Trees
    (1984), 3.4.3.
    """
    weight = _weight_of(scores)
    square = {n: np.concatenate([s.square_volt2 for s in parts]) for n, parts in scores.items()}
    rmse = {name: float(np.sqrt(np.average(s, weights=weight))) for name, s in square.items()}
    logs = {name: np.log(np.maximum(s, SMALLEST_VOLT2)) for name, s in square.items()}
    by_condition = {name: np.array([rmse_of(s) for s in parts]) for name, parts in scores.items()}
    reasons = _far_from_best(fitted_volt or {}, searched, celsius)
    sound = [name for name in scores if name not in reasons]
    chosen, equal, other = _simplest([n for n in sound if n not in searched], logs, rmse)
    reasons |= other
    for name in (member for member in sound if member in searched):
        against = _against(name, chosen, logs, rmse, by_condition)
        reasons[chosen if not against else name] = against or f"{name} is better beyond chance"
        chosen, equal = (chosen, equal) if against else (name, [name])
    typical = {name: float(np.exp(log.mean() / 2)) for name, log in logs.items()}
    words = _words(chosen, equal, typical, rmse, [name for name in scores if name not in sound])
    words += _warning(rmse[chosen])
    return Choice(chosen, rmse, words, reasons | {chosen: words.partition(". ")[0]})


def rmse_of(score):
    """Root mean square error over all rows of what was left out [V].

    Parameters
    ----------
    score : Score.
    """
    return float(np.sqrt(np.average(score.square_volt2, weights=score.rows)))


def typical_of(score):
    """Geometric mean of the blocks' rms errors [V].

    Parameters
    ----------
    score : Score.
    """
    return float(np.exp(np.log(np.maximum(score.square_volt2, SMALLEST_VOLT2)).mean() / 2))


def _weight_of(scores):
    """Number of rows of every block (b,), which must be the same for all members."""
    if not scores:
        raise Refusal("no member of the family could be fitted and scored at every temperature")
    rows = {name: np.concatenate([s.rows for s in parts]) for name, parts in scores.items()}
    if len({tuple(r) for r in rows.values()}) != 1:
        raise Refusal("members of the model were not scored on the same blocks")
    return next(iter(rows.values())).astype(float)


def _far_from_best(errors, searched, celsius):
    """Reasons against members that err far more than the best, by name; one member always stays.

    The best is one of the family: what a search has fitted to the same records says nothing against
    the others before it has been better on what was left out.
    """
    family = [name for name in errors if name not in searched]
    worst, reasons = {}, {}
    best = np.min([errors[name] for name in family], axis=0) if family else None
    for name, error in errors.items():
        ratio = np.where(error > best + MATERIAL_VOLT, error / np.maximum(best, 1e-9), 1.0)
        worst[name] = ratio.max()
        if worst[name] > FAR:
            k = int(np.argmax(ratio))
            place = f" at {celsius[k]:g} °C" if celsius else ""
            least = min(family, key=lambda other, k=k: errors[other][k])
            sentence = f"errs by {1e3 * error[k]:.2g} mV{place} over the records fitted, {least} by"
            reasons[name] = f"{sentence} {1e3 * best[k]:.2g} mV"
    if family and set(family) <= set(reasons):
        reasons.pop(min(family, key=worst.get))
    return reasons


def _simplest(names, logs, rmse):
    """The simplest of the equally good members, all of these, and why each other is not chosen."""
    best = min(names, key=lambda name: logs[name].mean())
    alike = [name for name in names if _equal(logs[name] - logs[best])]
    smallest = min(rmse[name] for name in alike)
    equal = [name for name in alike if rmse[name] <= NEAR * smallest]
    chosen = min(equal, key=lambda name: (size_of(member_named(name)), logs[name].mean()))
    reasons = dict.fromkeys(names, f"predicts blocks left out worse than {best}")
    reasons |= dict.fromkeys(
        alike, f"equal to {best} in most blocks, but its rms error is over a tenth larger"
    )
    reasons |= dict.fromkeys(equal, f"no better than {chosen}, which is simpler")
    return chosen, equal, reasons


def _against(name, chosen, logs, rmse, by_condition):
    """Reason against a member that a search has found, None where there is none."""
    better = logs[chosen] - logs[name]
    error = better.std(ddof=1) / np.sqrt(len(better)) if len(better) > 2 else np.inf
    if better.mean() <= SURE * error:
        sure = better.mean() / error if error > 0 else 0.0
        return (
            f"not better than {chosen} beyond chance ({sure:.1f} standard errors, {SURE:g} asked)"
        )
    if rmse[name] > rmse[chosen]:
        return f"errs by {1e3 * rmse[name]:.2g} mV rms, {chosen} by {1e3 * rmse[chosen]:.2g} mV"
    candidate, incumbent = by_condition[name], by_condition[chosen]
    if np.any(candidate > np.maximum(NEAR * incumbent, incumbent + MATERIAL_VOLT)):
        return f"worse than {chosen} at some temperature"
    return None


def _equal(difference):
    """Whether a mean difference is within the scatter between blocks."""
    if len(difference) < 3:
        return difference.mean() <= 0
    return difference.mean() <= CLEAR * difference.std(ddof=1) / np.sqrt(len(difference))


def _words(chosen, equal, typical, rmse, far):
    ranked = sorted(typical, key=typical.get)
    listed = ", ".join(f"{n} {1e3 * typical[n]:.2g} mV ({1e3 * rmse[n]:.2g})" for n in ranked)
    listed = f"Typical error of a block left out of the fit, rms of all in brackets: {listed}"
    listed += f". Out of the question over the records fitted: {', '.join(far)}" if far else ""
    equals = [name for name in ranked if name in equal and name != chosen]
    if equals:
        return f"{chosen} chosen: equal within chance to {', '.join(equals)}, and simpler. {listed}"
    second = next((name for name in ranked if name != chosen and name not in far), None)
    clear = f", clearly before {second}" if second else ", the only one left"
    return f"{chosen} chosen{clear}. {listed}"


def _warning(rmse_volt):
    """Sentence on an error that is too large for use, else ""."""
    if rmse_volt <= UNUSABLE_VOLT:
        return ""
    return (
        f". It misses what was left out by {1e3 * rmse_volt:.0f} mV rms, more than "
        f"{1e3 * UNUSABLE_VOLT:.0f} mV: nothing that needs the voltage should rest on it"
    )


INNER_SOC = (0.05, 0.95)  # the range over which validation is told, too


class FittedRecord(NamedTuple):
    """A record that the members were fitted to, thinned as in their fit.

    record : Record (n,), whose used rows count. block : (used rows,) number of the block of each,
    counted over the records of its temperature.
    """

    record: Record
    block: np.ndarray


class Judged(NamedTuple):
    """Errors of a member.

    scores : list of Score of blocks left out of its fit, one per condition.
    fit_rmse_volt : (conditions,) simulated through the records fitted, SoC 5–95 % [V].
    """

    scores: list
    fit_rmse_volt: np.ndarray


def fitted_records(model, basis, cell, tests, *, split_rest_second):
    """The records that a model was identified from, by condition.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, from `cell.cell_model`.
    basis : dict, from `basis.basis`. cell : CellFacts.
    tests : list of MeasuredTest, at least those fitted; others are passed over.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    conditions : list of lists of FittedRecord, in the order of the model's conditions.

    Raises
    ------
    Refusal : a condition whose tests are not among those given.
    """
    entries = model["members"][0]["conditions"]
    names = [name for entry in entries for name in entry["tests"]]
    fitted = [test for test in tests if test.facts.test in names]
    fitted = sorted(fitted, key=lambda test: names.index(test.facts.test))
    by_temperature, _ = records_by_temperature(
        fitted, basis, cell, split_rest_second=split_rest_second
    )
    rest = {"rest_second": split_rest_second}
    rest["rest_ampere"] = REST_C_RATE * basis["capacity_ampere_hour"]
    by_names = {
        tuple(record.test for record in fit_records.records): fit_records
        for fit_records in by_temperature
    }
    conditions = []
    for entry in entries:
        fit_records = by_names.get(tuple(entry["tests"]))
        if fit_records is None:
            raise Refusal(f"not to be compared: {', '.join(entry['tests'])} cannot be read again")
        size = {"capacity_ampere_hour": basis["capacity_ampere_hour"]}
        ready = ready_records(fit_records.records, **size)
        pairs = zip(ready, blocks_of_used(ready, **rest), strict=True)
        conditions.append([FittedRecord(*pair) for pair in pairs])
    return conditions


def errors_of(model, name, fitted_record):
    """Measured less simulated voltage of a member over the used rows of a record (n,) [V].

    Parameters
    ----------
    model : dict of schema cellwright-model/2. name : of the member. fitted_record : FittedRecord.
    """
    record = fitted_record.record
    return (record.voltage_volt - simulated(model, name, record).voltage_volt)[record.used]


def inner_rmse(records, errors_volt):
    """Error over SoC 5–95 % of the used rows of a condition [V]; over all where none lies there.

    Parameters
    ----------
    records : list of FittedRecord. errors_volt : list of (used rows,) of each, see `errors_of`.
    """
    soc = np.concatenate([fitted.record.soc[fitted.record.used] for fitted in records])
    error = np.concatenate(errors_volt)
    inner = (soc >= INNER_SOC[0]) & (soc <= INNER_SOC[1])
    return rms(error[inner] if inner.any() else error)


def decided(model, conditions, searched=None):
    """A model with its chosen member, and the table of reasons.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, with `left_out`.
    conditions : list of lists of FittedRecord, from `fitted_records`.
    searched : dict name → Judged, of members that a search has found.

    Returns
    -------
    model : the same with `chosen` and `choice`, and `left_out` of all members.
    rows : list of dict, one a member and temperature: model, ambient_temperature_celsius, blocks,
        typical_volt, left_out_rmse_volt, worst_volt (of a block), fit_rmse_volt (simulated, SoC
        5–95 %), chosen, reason.
    """
    judged = {
        name: judged_of(model, name, conditions) for name in model["left_out"][0]["square_volt2"]
    }
    judged |= searched or {}
    celsius = [entry["ambient_temperature_celsius"] for entry in model["left_out"]]
    choice = choose(
        {name: verdict.scores for name, verdict in judged.items()},
        celsius=celsius,
        fitted_volt={name: verdict.fit_rmse_volt for name, verdict in judged.items()},
        searched=tuple(searched or ()),
    )
    rows = [
        row | {"chosen": name == choice.name, "reason": choice.reasons[name]}
        for name, verdict in judged.items()
        for row in judged_rows(name, verdict, celsius)
    ]
    members = [m | {"left_out_rmse_volt": choice.rmse_volt[m["model"]]} for m in model["members"]]
    return model | {"members": members, "chosen": choice.name, "choice": choice.words}, rows


def judged_of(model, name, conditions):
    """Judged of a member of the family: left-out blocks and its simulation.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, with `left_out`. name : of the member.
    conditions : list of lists of FittedRecord, from `fitted_records`.
    """
    scores = [
        Score(np.array(fitted["square_volt2"][name]), np.array(fitted["rows"]))
        for fitted in model["left_out"]
    ]
    errors = [[errors_of(model, name, fitted) for fitted in condition] for condition in conditions]
    pairs = zip(conditions, errors, strict=True)
    return Judged(
        scores,
        np.array(
            [inner_rmse(condition, condition_errors) for condition, condition_errors in pairs]
        ),
    )


def judged_rows(name, judged, celsius):
    """Rows of a member in the table of reasons, without `chosen` and `reason`; see `decided`.

    Parameters
    ----------
    name : of the member. judged : Judged. celsius : temperature of each condition [degC].
    """
    for score, volt, condition_celsius in zip(
        judged.scores, judged.fit_rmse_volt, celsius, strict=True
    ):
        yield {
            "model": name,
            "ambient_temperature_celsius": condition_celsius,
            "blocks": len(score.rows),
            "typical_volt": typical_of(score),
            "left_out_rmse_volt": rmse_of(score),
            "worst_volt": float(np.sqrt(score.square_volt2.max())),
            "fit_rmse_volt": float(volt),
        }
