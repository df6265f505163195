"""The effects that were found as a member of the cell's model, judged like every other member."""

import numpy as np

from cellwright.effects.model import NAME, effect_member, temperatures
from cellwright.models.choice import Judged, decided, errors_of, fitted_records, inner_rmse
from cellwright.models.groups import course_celsius
from cellwright.models.instrument import words_of
from cellwright.models.selection import Score
from cellwright.refusal import Refusal


def finished(model, basis, cell, tests, found, *, split_rest_second):
    """A cell's model as the pipeline uses it: with the effects found, and its member chosen.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, from whatever source.
    basis : dict, from `models.basis.basis`. cell : dict, the cell's row of the sheet.
    tests : list of models.cell.FitTest: those fitted, and those that effects were searched in.
    found : dict, see `with_effects`, or None where nothing was searched.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    model : dict of the same schema. rows : list of dict, see `models.choice.decided`; none for a
        borrowed model, whose cell has no records that its members were fitted to.
    """
    if not model.get("left_out"):
        return model, []
    conditions = fitted_records(model, basis, cell, tests, split_rest_second=split_rest_second)
    searched = {}
    if found and found["effects"]:
        try:
            model, searched[NAME] = with_effects(model, found, tests, conditions)
        except Refusal as refusal:
            model = model | {"notes": [*model["notes"], f"{NAME} not made: {refusal}"]}
    return decided(model, conditions, searched)


def with_effects(model, found, tests, conditions):
    """A cell's model with a member that holds the effects found, and how that member does.

    Every block of the records fitted is predicted by the effects' model fitted without that block;
    a record that took no part in the search's fit by the model as it is. A record begins at the SoC
    that was found with the rest of it, as the family's members have its error in their OCV.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    found : dict, see `model.effect_member`, with `tests` (of the search's fit) and `folds`
        (`left_out.folds`).
    tests : list of models.cell.FitTest, whose temperatures the member is to hold.
    conditions : list of lists of choice.FittedRecord, one a condition of the model.

    Returns
    -------
    model : dict of the same schema, the member last. judged : choice.Judged, of the same blocks as
        the family's members.

    Raises
    ------
    Refusal : as `effect_member`.
    """
    courses = [course_celsius(test.facts, test.series)[0] for test in tests]
    stated = [test.facts["ambient_temperature_celsius"] for test in tests]
    known = temperatures(courses, stated, found["effects"])
    fits = [found, *(found | {"values": one["values"]} for one in found["folds"])]
    models = [_with(model, effect_member(one, model, known)) for one in fits]
    errors = [[_errors(one, models, fits) for one in part] for part in conditions]
    member = models[0]["members"][-1]
    whole = np.concatenate([one[0] for part in errors for one in part])
    fitted = {"fit_rmse_volt": float(np.sqrt(np.mean(whole**2))), "samples": len(whole)}
    for condition in member["conditions"]:
        condition |= fitted | {"tests": [one.test for part in conditions for one in part]}
    pairs = list(zip(conditions, errors, strict=True))
    judged = Judged(
        [_score(part, of_part, found["folds"]) for part, of_part in pairs],
        np.array([inner_rmse(part, [one[0] for one in of_part]) for part, of_part in pairs]),
    )
    notes = [*model["notes"], *(f"{NAME}: {told}" for told in words_of(member))]
    return models[0] | {"notes": notes}, judged


def _with(model, member):
    return model | {"members": [*model["members"], member]}


def _errors(one, models, fits):
    """Errors of a record by the whole fit and by each fold's, (1 + folds, used rows) [V]."""
    soc, found = one.record.soc, []
    for model, fit in zip(models, fits, strict=True):
        names = {test: f"soc0[{k}]" for k, test in enumerate(fit["tests"])}
        start = fit["values"].get(names.get(one.test), soc[0])
        moved = one._replace(record=one.record._replace(soc=soc + (start - soc[0])))
        found.append(errors_of(model, NAME, moved))
    return np.array(found)


def _score(records, errors, folds):
    """Error of each block of one condition, each row by the model that was fitted without it."""
    unseen = []
    for one, by_fit in zip(records, errors, strict=True):
        fold = _fold_of(one.test, one.record.test_time_second[one.record.used], folds)
        unseen.append(by_fit[fold + 1, np.arange(len(fold))])
    _, at = np.unique(np.concatenate([one.block for one in records]), return_inverse=True)
    rows = np.bincount(at)
    return Score(np.bincount(at, np.concatenate(unseen) ** 2) / rows, rows)


def _fold_of(test, time_second, folds):
    """Number of the fold that left a time of a test out; −1: the test was not in the fit at all."""
    spans = [
        (begin, k) for k, one in enumerate(folds) for t, begin, _ in one["blocks"] if t == test
    ]
    if not spans:
        return np.full(len(time_second), -1)
    begins, number = (np.array(column) for column in zip(*sorted(spans), strict=True))
    at = np.searchsorted(begins, time_second, side="right") - 1
    return number[np.maximum(at, 0)]
