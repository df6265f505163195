"""Whether a cell's model is better with the effects that were found: by what it was fitted to."""

import numpy as np

from cellwright.effects.model import NAME, effect_member, temperatures
from cellwright.models.basis import soc_of
from cellwright.models.groups import course_celsius
from cellwright.models.instrument import words_of
from cellwright.models.lookup import simulate_model
from cellwright.models.split import fit_mask
from cellwright.refusal import Refusal
from cellwright.series.anchor import REST_C_RATE


def with_effects(model, found, cell, tests, *, split_rest_second):
    """A cell's model with a member that holds the effects found.

    It becomes the chosen one where it errs less than the chosen member of the family over the
    same records, those of role fit (of role split the odd blocks); both run from the counted SoC.

    Parameters
    ----------
    model : dict of schema cellwright-model/2.
    found : dict, see `model.effect_member`. cell : dict, the cell's row of the sheet.
    tests : list of `models.cell.FitTest`: those that the effects were searched in.
    split_rest_second : shortest rest that cuts a record of role `split` [s].

    Returns
    -------
    model : dict of the same schema; the one given where nothing was found.

    Raises
    ------
    Refusal : none of the records can be simulated; as `effect_member`.
    """
    if not found["effects"]:
        return model
    usable, notes = _usable(model, cell, tests, split_rest_second)
    courses = [course_celsius(test.facts, test.series)[0] for test, _, _ in usable]
    stated = [test.facts["ambient_temperature_celsius"] for test, _, _ in usable]
    known = temperatures(courses, stated, found["effects"])
    member = effect_member(found, model, known)
    wider = model | {"members": [*model["members"], member]}
    own, family = (_rms(wider, name, usable) for name in (NAME, model["chosen"]))
    names = [test.facts["test"] for test, _, _ in usable]
    rows = int(sum(scored.sum() for _, _, scored in usable))
    for condition in member["conditions"]:
        condition |= {"fit_rmse_volt": own, "samples": rows, "tests": names}
    notes += [f"{NAME}: {told}" for told in words_of(member)]
    return wider | {
        "chosen": NAME if own < family else model["chosen"],
        "choice": _words(model, found["effects"], own, family, len(usable)),
        "notes": [*model["notes"], *notes],
    }


def _usable(model, cell, tests, rest_second):
    """(test, counted SoC, rows that count) of every record that can be simulated, and notes."""
    usable, notes = [], []
    for test in tests:
        try:
            soc = soc_of(test.series, model, test.facts, cell).soc
        except Refusal as refusal:
            notes.append(f"{NAME}: {test.facts['test']} took no part in the choice: {refusal}")
            continue
        usable.append((test, soc, _scored(model, test, rest_second)))
    if not usable:
        raise Refusal("; ".join(notes) or "no record of role fit to choose by")
    return usable, notes


def _scored(model, test, rest_second):
    time, current = (test.series[name] for name in ("test_time_second", "current_ampere"))
    if test.facts["role"] != "split":
        return np.ones(len(time), bool)
    rest = REST_C_RATE * model["capacity_ampere_hour"]
    return fit_mask(time, current, rest_second=rest_second, rest_ampere=rest)


def _rms(model, name, usable):
    errors = []
    for test, soc, scored in usable:
        record = (test.series["test_time_second"], test.series["current_ampere"], soc)
        celsius = course_celsius(test.facts, test.series)[0]
        run = simulate_model(model, name, *record, celsius, kind=test.facts["kind"])
        errors.append((test.series["voltage_volt"] - run.voltage_volt)[scored])
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _words(model, effects, own, family, records):
    """Why this member and not the other."""
    told = f"{NAME} ({', '.join(effects)}) errs by {1e3 * own:.2f} mV rms over the {records}"
    told += f" record(s) of role fit, {model['chosen']} by {1e3 * family:.2f} mV:"
    last = f"{NAME if own < family else model['chosen']} is chosen; validation took no part"
    before = model.get("choice")
    return "; ".join(filter(None, [before, f"{told} {last}"]))
