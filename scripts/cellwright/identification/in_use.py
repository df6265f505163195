"""Members of a model simulated through the records that they were fitted to, as in use."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import in_use, member_of
from cellwright.circuits.particle import NAME as PARTICLE
from cellwright.circuits.particle import of_document
from cellwright.identification import particle
from cellwright.identification.choice import (
    SURE,
    Score,
    choose,
    not_chosen,
    rmse_of,
    score_of,
    standard_errors,
    typical_of,
    usual_of,
    worst_of,
)
from cellwright.identification.edges import with_share
from cellwright.identification.identify import ready_records
from cellwright.identification.intervals import simulated
from cellwright.identification.messages import say
from cellwright.identification.validation import MATERIAL_VOLT, beyond_volt, is_inner
from cellwright.numerics.statistics import rms
from cellwright.records.basis import at_cycle
from cellwright.records.blocks import blocks_of_used, columns_of, cut_of
from cellwright.records.conditions import AT_REST_C_RATE
from cellwright.records.record import Record, laid_out, records_by_temperature
from cellwright.refusal import Refusal


class FittedRecord(NamedTuple):
    """A record that the members were fitted to, thinned as in their fit.

    record : Record (n,), whose used rows count. block : (used rows,) number of the block of each,
    counted over the records of its temperature. whole : Record with all rows; None: not kept.
    """

    record: Record
    block: np.ndarray
    whole: Record | None = None


class Judged(NamedTuple):
    """Errors of a member.

    scores : list of Score of blocks left out of its fit, one per condition.
    fit_rmse_volt : (conditions,) simulated through the records fitted, SoC 5–95 % [V].
    fit_beyond_volt : (conditions,) how far that leaves the range of the measured voltage at any
        SoC [V]; None: not looked at.
    """

    scores: list
    fit_rmse_volt: np.ndarray
    fit_beyond_volt: np.ndarray | None = None


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
    of_model = model.get("uncounted_edge_share"), basis["capacity_ampere_hour"]
    by_temperature = [with_share(one, *of_model) for one in by_temperature]
    rest = {"rest_second": split_rest_second}
    rest["rest_ampere"] = AT_REST_C_RATE * basis["capacity_ampere_hour"]
    by_names = {
        tuple(record.test for record in fit_records.records): fit_records
        for fit_records in by_temperature
    }
    rest["cut"] = cut_of(columns_of([one.records for one in by_temperature]), **rest)
    conditions = []
    for entry in entries:
        fit_records = by_names.get(tuple(entry["tests"]))
        if fit_records is None:
            raise Refusal(f"not to be compared: {', '.join(entry['tests'])} cannot be read again")
        size = {"capacity_ampere_hour": basis["capacity_ampere_hour"]}
        ready = ready_records(fit_records.records, **size)
        of_each = zip(ready, blocks_of_used(ready, **rest), fit_records.records, strict=True)
        conditions.append([FittedRecord(*one) for one in of_each])
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
    inner = is_inner(soc)
    return rms(error[inner] if inner.any() else error)


def furthest_beyond(records, errors_volt):
    """How far a simulation leaves the range of any record of a condition [V]; 0 where in none.

    Parameters
    ----------
    records : list of FittedRecord. errors_volt : list of (used rows,) of each, see `errors_of`.
    """
    measured = [fitted.record.voltage_volt[fitted.record.used] for fitted in records]
    pairs = zip(measured, errors_volt, strict=True)
    return max((beyond_volt(*pair) for pair in pairs if len(pair[0])), default=0.0)


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
        5–95 %), fit_beyond_volt (of the whole simulation), chosen, code, reason.
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
        beyond_volt={
            name: verdict.fit_beyond_volt
            for name, verdict in judged.items()
            if verdict.fit_beyond_volt is not None
        },
        searched=tuple(searched or ()),
    )
    rows = [
        row | {"chosen": name == choice.name} | reason_columns(*choice.reasons[name])
        for name, verdict in judged.items()
        for row in judged_rows(name, verdict, celsius)
    ]
    members = [m | {"left_out_rmse_volt": choice.rmse_volt[m["model"]]} for m in model["members"]]
    members = [_with_usual_errors(m, judged[m["model"]].scores, celsius) for m in members]
    # Whole tests may take its place back, see `proved`.
    before = {"in_place_of": choice.unsearched}
    members = [m | before if m["model"] in (searched or {}) else m for m in members]
    return model | {"members": members, "chosen": choice.name, "choice": choice.words}, rows


def beside_particle(model, rows, conditions):
    """A model that says whether its particle predicts better than the chosen member, and the table
    of reasons with the particle's rows.

    The rule is that of `choice.choose` for members that are found beside the family: the particle
    has to be better beyond chance, and at no temperature worse. That it errs more on the records
    fitted says nothing against it: far fewer numbers are fitted to all temperatures at once. It is
    not compared with a member that holds effects.

    Parameters
    ----------
    model, rows : as `proved` gives them. conditions : see `decided`.
    """
    if not model.get("particle") or not rows:
        return model, rows
    chosen = model["chosen"]
    celsius = [entry["ambient_temperature_celsius"] for entry in model["left_out"]]
    left_out = _left_out_of(model["particle"])
    errors = [[errors_of(model, PARTICLE, one) for one in condition] for condition in conditions]
    both = {PARTICLE: Judged(left_out, *simulated_errors(conditions, errors))}
    in_use, reason = False, not_chosen("beside_effects", best=chosen)
    if chosen in model["left_out"][0]["square_volt2"]:
        both |= {chosen: judged_of(model, chosen, conditions)}
        choice = choose(
            {name: verdict.scores for name, verdict in both.items()},
            celsius=celsius,
            beyond_volt={name: verdict.fit_beyond_volt for name, verdict in both.items()},
            searched=(PARTICLE,),
        )
        in_use, reason = choice.name == PARTICLE, choice.reasons[PARTICLE]
    of_particle = [
        row | {"chosen": in_use} | reason_columns(*reason)
        for row in judged_rows(PARTICLE, both[PARTICLE], celsius)
    ]
    about = {"in_use": in_use, "left_out_rmse_volt": _rmse_of_all(left_out), "choice": reason.text}
    return model | {"particle": model["particle"] | about}, [*rows, *of_particle]


def particle_task(model, fitted, basis, cell, tests, *, split_rest_second):
    """What the particle of a model was fitted to.

    Parameters
    ----------
    model : dict of schema cellwright-model/2 with a particle. fitted : list of lists of
        FittedRecord, from `fitted_records`.
    basis, cell, tests, split_rest_second : as of `fitted_records`.

    Returns
    -------
    task : particle.Task. conditions : of the model, as `particle.task_of` takes them, without loads
        at temperatures of which nothing else was fitted.
    """
    celsius = [entry["ambient_temperature_celsius"] for entry in model["ocv"]]
    conditions = [
        (at, [one.whole for one in each], [one.record for one in each], [one.block for one in each])
        for at, each in zip(celsius, fitted, strict=True)
    ]
    names = model["particle"].get("beside", ())
    lone = [test for test in tests if test.facts.test in names]
    beside, _ = records_by_temperature(lone, basis, cell, split_rest_second=split_rest_second)
    shares = model.get("uncounted_edge_share"), model["capacity_ampere_hour"]
    every = [*conditions, *particle.of_lone_loads([with_share(one, *shares) for one in beside])]
    every.sort(key=lambda condition: condition[0])
    size = {"capacity_ampere_hour": model["capacity_ampere_hour"]}
    return particle.task_of(every, model["ocv"], **size), conditions


def with_parts(model, rows, task, conditions):
    """A model that says what each part of its particle is worth, and the table of reasons with rows
    of the particle without it.

    A part is worth something where blocks left out are missed by more without it, by two standard
    errors, and at some temperature by what somebody acts on: it takes the square of `MATERIAL_VOLT`
    off the mean square error, as a name of the search has to, and over all they are missed by more.
    That is so on the tests fitted: what they do not excite is worth nothing there.

    Parameters
    ----------
    model : dict of schema cellwright-model/2 whose particle is in use. rows : of the table of
        reasons. task, conditions : from `particle_task`.

    Returns
    -------
    model : the same, its particle with `parts`: list of dict, part, left_out_rmse_volt, standard
        errors (by which it is better with it), worth (whether it is). rows : with those of each.
    """
    whole, fitted = _left_out_of(model["particle"]), of_document(model["particle"])
    parts, rows, celsius = [], list(rows), [at for at, *_ in conditions]
    for part in particle.WITHOUT:
        if part in particle.OVER_TEMPERATURE and len(fitted.celsius) < 2:
            continue
        scores = particle.left_out_without(task, fitted, part, conditions)
        sure = standard_errors(scores, whole)
        ends = zip(scores, whole, strict=True)
        more = [rmse_of(without) ** 2 - rmse_of(with_it) ** 2 for without, with_it in ends]
        volt = _rmse_of_all(scores)
        larger = volt > _rmse_of_all(whole) and np.nanmax(more) > MATERIAL_VOLT**2
        worth = bool(sure > SURE and larger)
        about = {"left_out_rmse_volt": volt, "standard_errors": sure, "worth": worth}
        parts.append({"part": part} | about)
        code = "part_worth" if worth else "part_worthless"
        wanted = {"wanted": SURE, "least": 1e3 * MATERIAL_VOLT}
        words = say(f"not_chosen.{code}", part=say(f"part.{part}"), sure=sure, **wanted)
        unknown = Judged(scores, np.full(len(celsius), np.nan))
        rows += [
            row | {"chosen": False} | reason_columns(code, words)
            for row in judged_rows(f"{PARTICLE} without {part}", unknown, celsius)
        ]
    return model | {"particle": model["particle"] | {"parts": parts}}, rows


def _left_out_of(document):
    """Scores of a particle of a model file, one a temperature."""
    return [Score(np.array(volt2), np.array(count)) for volt2, count in document["left_out"]]


def _rmse_of_all(scores):
    rows = np.concatenate([score.rows for score in scores])
    square_volt2 = np.concatenate([score.square_volt2 for score in scores])
    return rmse_of(Score(square_volt2, rows)) if len(rows) else None


def marked(model, rows):
    """Rows of the table of reasons of which those of what predicts best are the chosen ones.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, finished. rows : as `decided` gives them.
    """
    best, table = in_use(model), model["chosen"]
    rows = [row | {"chosen": row["model"] == best} for row in rows]
    serves = reason_columns(*not_chosen("serves_tables", best=best))
    return [row | serves if row["model"] == table != best else row for row in rows]


def _with_usual_errors(member, scores, celsius):
    """A member whose conditions tell what it usually errs by on what was left out of its fit."""
    usual = {at: usual_of(score) for at, score in zip(celsius, scores, strict=True)}
    usual = {at: volt for at, volt in usual.items() if np.isfinite(volt)}
    told = [
        condition | {"left_out_usual_volt": usual[at]}
        if (at := condition["ambient_temperature_celsius"]) in usual
        else condition
        for condition in member["conditions"]
    ]
    return member | {"conditions": told}


def proved(model, rows, tests, cell, *, split_rest_second):
    """Keep the member with effects only if its error on tests left out is lower.

    Blocks left out of a test that the effects were searched in have chosen the effects too: what
    fits that test alone (its sampling, its sensor) passes there, and misses the next test. So both,
    the member and the one that it would replace, are simulated through tests that took part in
    neither the search nor a fit. The rule is that of `choice.choose` for members that a search has
    found: better by two standard errors of the blocks of these tests, no larger error over all, and
    worse in none of them. Else, and where there is no such test, the one that it would replace is
    chosen. Their validation error is then that of the better of two.

    Parameters
    ----------
    model, rows : as `decided` gives them.
    tests : list of MeasuredTest that took no part, of the age of the model; those of role `split`
        are passed over.
    cell : CellFacts. split_rest_second : shortest rest that cuts a record [s].

    Returns
    -------
    model, rows : the same where no member with effects is chosen.
    """
    chosen = member_of(model)
    name, rival = chosen["model"], chosen.get("in_place_of")
    if rival is None:
        return model, rows
    scores, used, notes = {rival: [], name: []}, [], []
    for test in (test for test in tests if test.facts.role == "validation"):
        try:
            by_member = _scores_of_test(model, scores, test, cell, split_rest_second)
        except Refusal as refusal:
            fields = {"test": test.facts.test, "name": name, "refusal": refusal}
            notes.append(say("choice.not_judging", **fields))
            continue
        used.append(test.facts.test)
        for member, score in by_member.items():
            scores[member].append(score)
    wins, (code, why) = False, not_chosen("no_whole_test")
    if used and len(scores[name][0].rows):
        choice = choose(scores, searched=(name,), whole_tests=True)
        errors = " against ".join(f"{1e3 * choice.rmse_volt[n]:.2g}" for n in (name, rival))
        wins = choice.name == name
        code, why = ("better", say("choice.better")) if wins else choice.reasons[name]
        fields = {"errors": errors, "rival": rival, "tests": ", ".join(used)}
        why = say("choice.whole_tests", why=why, **fields)
    end = "choice.stays" if wins else "choice.gives_way"
    verdict = say(end, name=name, rival=rival, why=why)
    taken = name if wins else rival
    reasons = {taken: reason_columns("whole_tests", verdict)}
    if not wins:
        reasons[name] = reason_columns(code, say("choice.not_chosen", why=why))
    rows = [row | {"chosen": row["model"] == taken} | reasons.get(row["model"], {}) for row in rows]
    about = {"choice": f"{model['choice']}. {verdict}", "notes": [*model["notes"], *notes]}
    return model | {"chosen": taken} | about, rows


def reason_columns(code, text):
    """Columns of the table of reasons: why a member is chosen or not, as a code and in words."""
    return {"code": code, "reason": text}


def _scores_of_test(model, names, test, cell, split_rest_second):
    """Score of each of some members on one test, by its loads with their rests, or its parts."""
    aged = at_cycle(model, test.facts.cycle)
    record = laid_out(test, aged, cell, split_rest_second=split_rest_second, proof=True)
    rest = {"rest_second": split_rest_second}
    rest["rest_ampere"] = AT_REST_C_RATE * aged["capacity_ampere_hour"]
    (block,) = blocks_of_used([record], cut=cut_of(columns_of([[record]]), **rest), **rest)
    fitted_record = FittedRecord(record, block)
    return {name: score_of(block, errors_of(aged, name, fitted_record)) for name in names}


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
    return Judged(scores, *simulated_errors(conditions, errors))


def simulated_errors(conditions, errors_volt):
    """`fit_rmse_volt` and `fit_beyond_volt` of Judged, (conditions,) each [V].

    Parameters
    ----------
    conditions : list of lists of FittedRecord. errors_volt : the same of (used rows,) errors.
    """
    pairs = list(zip(conditions, errors_volt, strict=True))
    return tuple(np.array([of(*pair) for pair in pairs]) for of in (inner_rmse, furthest_beyond))


def judged_rows(name, judged, celsius):
    """Rows of a member in the table of reasons, without `chosen` and why; see `decided`.

    Parameters
    ----------
    name : of the member. judged : Judged. celsius : temperature of each condition [degC].
    """
    beyond = judged.fit_beyond_volt
    beyond = np.full(len(celsius), np.nan) if beyond is None else beyond
    for score, volt, beyond_at, condition_celsius in zip(
        judged.scores, judged.fit_rmse_volt, beyond, celsius, strict=True
    ):
        yield {
            "model": name,
            "ambient_temperature_celsius": condition_celsius,
            "blocks": len(score.rows),
            "typical_volt": typical_of(score),
            "left_out_rmse_volt": rmse_of(score),
            "worst_volt": worst_of(score),
            "fit_rmse_volt": float(volt),
            "fit_beyond_volt": float(beyond_at),
        }
