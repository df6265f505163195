"""The model in use with the effects that it lacks, as a member of the model file.

The search of the base `own` finds them with a companion circuit beside the member's voltage, and so
they stand in the model file: a companion with the effects and one without,

    voltage = scale·(member − companion without) + companion with
"""

import numpy as np

from cellwright.circuits.instrument import words_of
from cellwright.circuits.model_file import member_of
from cellwright.effects.given.case import resistances
from cellwright.effects.library import LIBRARY
from cellwright.effects.member import KNOTS, NAME, distinct, effect_member, temperatures
from cellwright.identification.choice import Score, rmse_of
from cellwright.identification.in_use import Judged, decided_beside
from cellwright.refusal import Refusal

SUFFIX, OWN_SUFFIX = "+effects", "+own_effects"


def name_with_effects(member):
    """Name of a member with the effects that it lacks; `2RC+effects` is what a plain search found.

    Parameters
    ----------
    member : its name.
    """
    name = member + SUFFIX
    return member + OWN_SUFFIX if name == NAME else name


def with_own_effects(model, rows, effect_model):
    """A cell's model with the effects that its chosen member lacks, chosen if that is better.

    Both are compared on the records that the search was fitted to, block by block, each from the
    SoC that counting gives: the member as it is, with effects that were found without the block
    (`judged.judged_blocks`). The rule is that of `choice.choose` for members that a search finds.

    Parameters
    ----------
    model : dict of schema cellwright-model/2, from `member.finished`. rows : list of dict, its
        table of reasons, see `in_use.decided`.
    effect_model : dict, `model` of a Finding of the base `own`; None: nothing was searched.

    Returns
    -------
    model : dict of the same schema, the member last and maybe `chosen`; as it was where no effect
        was found, and with a note where it could not be added. rows : list of dict, with those of
        the member.
    """
    # Effects too small for a name may be in the model of a search that names nothing.
    if not effect_model or "blocks" not in effect_model:
        return model, rows
    try:
        entry = own_member(effect_model, model)
    except Refusal as refusal:
        name = name_with_effects(effect_model["given"]["member"])
        return model | {"notes": [*model["notes"], f"{name} not made: {refusal}"]}, rows
    return _decided(model, rows, entry, effect_model["blocks"])


def own_member(effect_model, model, library=LIBRARY):
    """Member of a model file that is one of its members and the effects that it lacks.

    Parameters
    ----------
    effect_model : dict, see `with_own_effects`. model : dict of schema cellwright-model/2.
    library : effects by id.

    Returns
    -------
    member : dict; its circuit is that of the member it begins from, its name in `of`.

    Raises
    ------
    Refusal : another member is chosen than the one that was searched, one that holds effects of a
        search already, records fitted that are one block, or as `member.effect_member`.
    """
    given = effect_model["given"]
    origin = member_of(model, given["member"])
    if origin["model"] != model["chosen"]:
        raise Refusal(f"effects of {origin['model']} were found, the chosen member is another")
    if "effects" in origin:
        raise Refusal(f"{origin['model']} holds the effects of another search already")

    def courses(temperature_celsius):
        both = resistances(origin, KNOTS, temperature_celsius)
        return both[0] / given["ohmic_mean_ohm"], both[1] / given["slow_mean_ohm"]

    if not effect_model["blocks"]:
        raise Refusal("the records fitted are one block: effects cannot be judged without it")
    celsius = _temperatures(origin, effect_model)
    # The member as given stands on the counted scale.
    plain = {"values": given["values"], "std": {}, "effects": [], "start_shift_soc": 0.0}
    bare = effect_model | plain
    with_effects, without = (
        effect_member(found, model, celsius, library, courses=courses)
        for found in (effect_model, bare)
    )
    companions = {
        "scale": effect_model["values"].get("known", 1.0),
        "with": with_effects,
        "without": without | {"effects": []},
    }
    return origin | {
        "model": name_with_effects(origin["model"]),
        "of": origin["model"],
        "effects": list(effect_model["effects"]),
        "sizes": _sizes(effect_model, library),
        "left_out_rmse_volt": None,
        "companions": companions,
    }


def _sizes(effect_model, library):
    """Rows of the parameters of the effects: parameter, value, std, unit."""
    return [
        {
            "parameter": name,
            "value": effect_model["values"][name],
            "std": effect_model.get("std", {}).get(name),
            "unit": parameter.unit,
        }
        for effect in (library[name] for name in effect_model["effects"])
        for parameter, name in zip(effect.parameters, effect.names, strict=True)
    ]


def _temperatures(origin, effect_model):
    """Temperatures of the companions: of the member's conditions and of the records [degC]."""
    known = [c["ambient_temperature_celsius"] for c in origin["conditions"]]
    known = [float(celsius) for celsius in known if celsius is not None]
    records = {tuple(block["celsius"]) for block in effect_model["blocks"]}
    courses = [np.array(course) for course in sorted(records)]
    held = [np.array([celsius]) for celsius in known]
    stated = [float(course[1]) for course in courses]
    return temperatures([*courses, *held], [*stated, *known], effect_model["effects"])


def _decided(model, rows, entry, blocks):
    """The model with the member, on the blocks of its search; see `in_use.decided_beside`."""
    parts, celsius = _by_temperature(blocks)
    of_origin, scores = ([_score(part, key) for part in parts] for key in ("member", "left_out"))
    fitted = np.array([rmse_of(_score(part, "with_effects")) for part in parts])
    judged = Judged(scores, fitted)
    model, rows = decided_beside(model, rows, entry, judged, of_origin, celsius)
    name = entry["model"]
    notes = [f"{name}: {words}" for words in words_of(entry["companions"]["with"])]
    return model | {"notes": [*model["notes"], *notes]}, rows


def _by_temperature(blocks):
    """Blocks of records of one temperature, and their temperatures [degC]."""
    means = np.array([block["celsius"][1] for block in blocks])
    kept = distinct(sorted(means))
    nearest = np.abs(np.subtract.outer(means, kept)).argmin(axis=1)
    pairs = [(k, celsius) for k, celsius in enumerate(kept) if np.any(nearest == k)]
    parts = [[b for b, at in zip(blocks, nearest, strict=True) if at == k] for k, _ in pairs]
    return parts, [celsius for _, celsius in pairs]


def _score(blocks, key):
    """Score of blocks: mean square error under a key of `judged.judged_blocks`."""
    square = np.array([block["square_volt2"][key] for block in blocks])
    return Score(square, np.array([block["rows"] for block in blocks]))
