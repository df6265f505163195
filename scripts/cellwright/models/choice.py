"""Which member a finished model uses: all members on the records that they were fitted to.

Identification chooses by blocks left out of linear fits. A finished model also mixes temperatures,
follows laws over them, and may hold a member that a search for missing effects has found; so its
members are compared once more, as they are simulated.
"""

from typing import NamedTuple

import numpy as np

from cellwright.models.groups import groups_of
from cellwright.models.identify import ready_records
from cellwright.models.lookup import simulate_model
from cellwright.models.records import Record
from cellwright.models.selection import Score, choose, rmse_of, typical_of
from cellwright.models.split import blocks_of_used
from cellwright.refusal import Refusal
from cellwright.series.anchor import REST_C_RATE

INNER_SOC = (0.05, 0.95)  # the range over which validation is told, too


class FittedRecord(NamedTuple):
    """A record that the members were fitted to, thinned as in their fit.

    test, kind : name and kind, as in the sheet. record : records.Record (n,), whose used rows
    count. celsius : (n,) temperature of the cell [degC]. block : (used rows,) number of the block
    of each, counted over the records of its temperature.
    """

    test: str
    kind: str
    record: Record
    celsius: np.ndarray
    block: np.ndarray


class Judged(NamedTuple):
    """How a member does: scores, list of Score, one a condition, of blocks left out of its fit.

    fit_rmse_volt : (conditions,) simulated through the records fitted, SoC 5–95 % [V].
    """

    scores: list
    fit_rmse_volt: np.ndarray


def fitted_records(model, basis, cell, tests, *, split_rest_second):
    """The records that a model was identified from, by condition.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, from `cell.cell_model`.
    basis : dict, from `basis.basis`. cell : dict, the cell's row of the sheet.
    tests : list of cell.FitTest, at least those fitted; others are passed over.
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
    known = [test for test in tests if test.facts["test"] in names]
    known = sorted(known, key=lambda test: names.index(test.facts["test"]))
    groups, _ = groups_of(known, basis, cell, split_rest_second=split_rest_second)
    kinds = {test.facts["test"]: test.facts["kind"] for test in known}
    rest = {"rest_second": split_rest_second}
    rest["rest_ampere"] = REST_C_RATE * basis["capacity_ampere_hour"]
    by_names = {group.tests: group for group in groups}
    found = []
    for entry in entries:
        group = by_names.get(tuple(entry["tests"]))
        if group is None:
            raise Refusal(f"not to be compared: {', '.join(entry['tests'])} cannot be read again")
        found.append(_records(group, kinds, rest))
    return found


def _records(group, kinds, rest):
    ready = ready_records(group.records)
    blocks = blocks_of_used(ready, **rest)
    courses = [
        np.interp(thin.test_time_second, full.test_time_second, course)
        for thin, full, course in zip(ready, group.records, group.courses, strict=True)
    ]
    parts = zip(group.tests, ready, courses, blocks, strict=True)
    return [FittedRecord(test, kinds[test], *rest_of) for test, *rest_of in parts]


def errors_of(model, name, one):
    """Measured less simulated voltage of a member over the used rows of a record (n,) [V].

    Parameters
    ----------
    model : dict of schema cellwright-model/2. name : of the member. one : FittedRecord.
    """
    record = one.record
    read = (record.test_time_second, record.current_ampere, record.soc)
    run = simulate_model(model, name, *read, one.celsius, kind=one.kind)
    return (record.voltage_volt - run.voltage_volt)[record.used]


def inner_rmse(records, errors_volt):
    """Error over SoC 5–95 % of the used rows of a condition [V]; over all where none lies there.

    Parameters
    ----------
    records : list of FittedRecord. errors_volt : list of (used rows,) of each, see `errors_of`.
    """
    soc = np.concatenate([one.record.soc[one.record.used] for one in records])
    error = np.concatenate(errors_volt)
    inner = (soc >= INNER_SOC[0]) & (soc <= INNER_SOC[1])
    return np.sqrt(np.mean((error[inner] if inner.any() else error) ** 2))


def decided(model, conditions, found=None):
    """A model with the member chosen that is best in use, and the table that says why.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, with `left_out`.
    conditions : list of lists of FittedRecord, from `fitted_records`.
    found : dict name → Judged, of members that a search has found.

    Returns
    -------
    model : the same with `chosen` and `choice`, and `left_out` of all members.
    rows : list of dict, one a member and temperature: model, ambient_temperature_celsius, blocks,
        typical_volt, left_out_rmse_volt, worst_volt (of a block), fit_rmse_volt (simulated, SoC
        5–95 %), chosen, reason.
    """
    judged = {
        name: _judged(model, name, conditions) for name in model["left_out"][0]["square_volt2"]
    }
    judged |= found or {}
    celsius = [entry["ambient_temperature_celsius"] for entry in model["left_out"]]
    choice = choose(
        {name: one.scores for name, one in judged.items()},
        celsius=celsius,
        fitted_volt={name: one.fit_rmse_volt for name, one in judged.items()},
        found=tuple(found or ()),
    )
    rows = [
        row | {"chosen": name == choice.name, "reason": choice.reasons[name]}
        for name, one in judged.items()
        for row in _rows(name, one, celsius)
    ]
    members = [m | {"left_out_rmse_volt": choice.rmse_volt[m["model"]]} for m in model["members"]]
    return model | {"members": members, "chosen": choice.name, "choice": choice.words}, rows


def _judged(model, name, conditions):
    """A member of the family, by what its identification left out, and simulated."""
    scores = [
        Score(np.array(one["square_volt2"][name]), np.array(one["rows"]))
        for one in model["left_out"]
    ]
    errors = [[errors_of(model, name, one) for one in part] for part in conditions]
    pairs = zip(conditions, errors, strict=True)
    return Judged(scores, np.array([inner_rmse(part, of_part) for part, of_part in pairs]))


def _rows(name, judged, celsius):
    for score, volt, at in zip(judged.scores, judged.fit_rmse_volt, celsius, strict=True):
        yield {
            "model": name,
            "ambient_temperature_celsius": at,
            "blocks": len(score.rows),
            "typical_volt": typical_of(score),
            "left_out_rmse_volt": rmse_of(score),
            "worst_volt": float(np.sqrt(score.square_volt2.max())),
            "fit_rmse_volt": float(volt),
        }
