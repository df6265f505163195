"""All witnesses of one verdict: of what it names, and of what it does not name and they show."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.library import LIBRARY
from cellwright.effects.library.quantities import QUANTITIES
from cellwright.effects.witnesses.charge import of_capacities, of_records
from cellwright.effects.witnesses.resistances import of_pulses, of_spectra
from cellwright.effects.witnesses.statement import (
    AGREES,
    CONTRADICTS,
    DEVIATIONS,
    SILENT,
    Witness,
    in_words,
    rules_out,
    same,
    size_of,
)
from cellwright.effects.witnesses.voltages import of_entropy, of_moved_ocv, of_rests, of_slow_test
from cellwright.records import inputs
from cellwright.result import Result

NO_ONE_SIZE = "of what the verdict names it has no one size at all states of charge"


class Others(NamedTuple):
    """Other measurements of a cell than the records that are searched.

    tables, basis, ambient : as of `measured_of`, without `series`.
    """

    tables: dict
    basis: dict
    ambient: dict


def contradicted(entries, model, measured, library):
    """Effects of a search that another measurement of the cell rules out, see `rules_out`.

    Parameters
    ----------
    entries : of effects, each with `effect` (id) and `parameters` as in a verdict.
    model : dict, as a search leaves it. measured : list of Measured. library : dict of Effect.

    Returns
    -------
    found : list of dict, one an effect: effect, measurement, quantity in words, measured,
        measured_std, searched, searched_std and unit.
    """
    values, found = values_of(model), {}
    for entry in entries:
        effect = library[entry["effect"]]
        for one in measured:
            if effect.quantity != one.quantity or one.reason or effect.id in found:
                continue
            value, std = implied(effect, entry, values, one.at)
            if rules_out(one, value, std):
                numbers = {"measured": one.value, "measured_std": one.std}
                numbers |= {"searched": value, "searched_std": std, "unit": one.unit}
                about = {"effect": effect.id, "measurement": one.name, "quantity": one.words}
                found[effect.id] = about | {
                    name: number if isinstance(number, str) else float(number)
                    for name, number in numbers.items()
                }
    return list(found.values())


def measured_of(tables, basis, model, *, ambient):
    """All that independent measurements of a cell tell, before any verdict is looked at.

    Parameters
    ----------
    tables : dict of lists of dict: resistance, eis, relaxation, capacity, ocv_entropic, each as its
        stage has it; `series` as a dict of columns. Absent or empty: not measured.
    basis : dict, of the cell. model : dict, as a search leaves it: values, ocv_soc, ocv_volt,
        capacity_ampere_hour; {} where there is none. ambient : dict, chamber by test [degC].

    Returns
    -------
    measured : list of Measured.
    """
    values, ampere = values_of(model), basis.get("capacity_ampere_hour") or np.nan
    size = {"capacity_ampere_hour": ampere}
    return [
        *of_spectra(tables.get("eis", []), **size),
        *of_pulses(tables.get("resistance", []), **size),
        *of_rests(tables.get("relaxation", []), values, **size),
        *of_slow_test(basis, values),
        *of_records(tables.get("series", {}), ambient, model | size),
        *of_entropy(tables.get("ocv_entropic", [])),
        *of_capacities(tables.get("capacity", [])),
        *of_moved_ocv(basis),
    ]


def values_of(model):
    """Parameters of a model by name, with its capacity and the temperatures of its fit."""
    known = ("capacity_ampere_hour", "fitted_celsius", "aged_day")
    return model.get("values", {}) | {name: model[name] for name in known if name in model}


def witnesses(verdict, model, basis, tables, *, ambient_celsius=None, library=None):
    """Which independent measurements of a cell agree with a verdict, contradict it, or are silent.

    verdict, model : of `missing_effect`.
    tables : rows or DataFrames by name, what is absent was not measured: resistance, eis,
        relaxation, capacity and ocv_entropic, with the test's temperature, SoC and cycle beside
        each row, and of capacities `started`, its date, where it is known; `series`, that of
        `missing_effect`.
    ambient_celsius : chamber's temperature by test [°C].
    library : effects by id, None: all of `effects.library.LIBRARY`.

    Returns rows, one a witness: what is measured, what the verdict implies, which it says.
    Source: docs/missing-effect.md.
    """
    content, known = inputs.basis(basis), dict(tables)
    verdict, model = inputs.content(verdict), inputs.content(model)
    series = inputs.columns(known.pop("series", {}))
    rows = {name: inputs.rows(table) for name, table in known.items()} | {"series": series}
    measured = measured_of(rows, content, model, ambient=ambient_celsius or {})
    return Result({"rows": witnesses_of(verdict, model, measured, library or LIBRARY)})


def witnesses_of(verdict, model, measured, library):
    """Which measurements agree with a verdict, contradict it, or are silent.

    1. Of each effect that the verdict names (or gives as the nearest explanation) every
       measurement of it speaks: what the effect implies of the measured quantity is held against
       it, by `statement.same`.
    2. Of an effect that is not named only a measurement speaks that shows it plainly: it
       contradicts.

    Parameters
    ----------
    verdict : dict of the contract. model : dict, as a search leaves it.
    measured : list of Measured. library : dict of Effect by id.

    Returns
    -------
    found : list of Witness, those of named effects first, in the verdict's order.
    """
    entries = [*verdict["effects"], *verdict.get("partial", [])]
    entries = {one["effect"]: one for one in entries}
    values = values_of(model)
    spoken = [
        _of_named(one, library[effect], entry, values)
        for effect, entry in entries.items()
        if effect in library
        for one in measured
        if library[effect].quantity == one.quantity
    ]
    explained = {other for one in entries.values() for other in one.get("alternatives", [])}
    showing = [
        (one, [effect for effect in library.values() if effect.quantity == one.quantity])
        for one in measured
        if _shows(one)
    ]
    hidden = [
        _of_unnamed(one, effects)
        for one, effects in showing
        if effects and not {*entries, *explained} & {effect.id for effect in effects}
    ]
    return [*spoken, *hidden]


def _shows(one):
    return one.material and not same(one.value, one.neutral, one.std, neutral=one.neutral)


def _of_named(one, effect, entry, values):
    if one.reason:
        blank = (np.nan, np.nan, one.unit, np.nan, False)
        return Witness(one.name, effect.id, True, SILENT, *blank, one.reason)
    value, doubt = implied(effect, entry, values, one.at)
    if not np.isfinite(value):
        blank = (one.value, value, one.unit, np.nan, False)
        return Witness(one.name, effect.id, True, SILENT, *blank, f"{one.words}: {NO_ONE_SIZE}")
    stated = np.isfinite([one.std, doubt]).all()
    std = float(np.hypot(one.std, doubt)) if stated else np.nan
    agrees = same(one.value, value, std, neutral=one.neutral)
    alike = (
        np.isfinite(std)
        and value != one.neutral
        and abs(one.value - one.neutral) <= DEVIATIONS * std
    )
    said = in_words(one.value, one.unit, one.std)
    text = f"{one.words}: {said} measured, {in_words(value, one.unit, doubt)} by the verdict"
    word = AGREES if agrees else CONTRADICTS
    alongside = size_of(one.value, one.neutral) * size_of(value, one.neutral) > 0
    shown = bool(alongside and _shows(one))
    # A reading without a deviation of its own cannot contradict a size that allows for it.
    allowed = not stated and np.isfinite(doubt) and abs(one.value - value) <= DEVIATIONS * doubt
    if agrees and alike:
        word, text = SILENT, f"{text}: it fits no effect just as well"
    elif allowed and not agrees:
        word, text = SILENT, f"{text}: within two deviations of the verdict, its own is not known"
    elif shown and not agrees:
        text += ": the effect is there, with another size"
    numbers = (one.value, value, one.unit, std)
    return Witness(one.name, effect.id, True, word, *numbers, shown, text)


def implied(effect, entry, values, at):
    """What an effect of a verdict implies of its quantity, and the standard deviation of that.

    The deviation adds up those of the effect's parameters, as if they were independent.

    Parameters
    ----------
    effect : Effect. entry : of the verdict, with `parameters`.
    values : dict of the model's parameters, with capacity_ampere_hour. at : conditions.

    Returns
    -------
    value, std : in the unit of its quantity; std is NaN where no parameter states one.
    """
    own = {name: one["value"] for name, one in entry["parameters"].items()}
    stds = {name: one.get("std") for name, one in entry["parameters"].items()}
    function = QUANTITIES[effect.quantity]
    value = function(effect, own, values, at)
    moved = [
        function(effect, own | {name: own[name] + std}, values, at) - value
        for name, std in stds.items()
        if std is not None and np.isfinite(std)
    ]
    return value, float(np.sqrt(np.sum(np.square(moved)))) if moved else np.nan


def _of_unnamed(one, effects):
    """Witness of the most general of the effects that would show in a measurement."""
    effect = max(effects, key=lambda effect: len(effect.parameters))
    said = in_words(one.value, one.unit, one.std)
    text = f"not named, although measured: {one.words} {said}"
    numbers = (one.value, one.neutral, one.unit, one.std)
    return Witness(one.name, effect.id, False, CONTRADICTS, *numbers, True, text)
