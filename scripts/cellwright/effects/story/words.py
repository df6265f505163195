"""A verdict in words, for a reader who knows no statistics: one sentence first, then the rest."""

import re
from typing import NamedTuple

from cellwright.effects.library import known_effects
from cellwright.effects.story.places import millivolt, near, where
from cellwright.effects.story.sizes import Size, sizes_as_used
from cellwright.effects.witnesses.statement import in_words

# Answers of a search that are no effect.
ANSWERS = {"none": "nothing missing", "unknown": "something unknown"}
KNOWN = {effect.id: effect for effect in known_effects()}
BENT = 1.1  # times its error as it is, beyond which a given model was bent by the records fitted
SURE = 0.9  # probability of a name from which on it is sure
SHOWN_WORSE, SHOWN_STARTS = 2, 3
# Units of sizes outside the vocabulary in words, and over those of the verdict.
UNIT_IN_WORDS = {"1/h": ("% in an hour", 1e2)}


class Phrases(NamedTuple):
    """How a paragraph speaks of what was searched.

    where : on which records, of which quantity, the error is. healthy : the model without an
    effect, and its verb. none : what does not explain an unknown error. named : what the names
    are named of, and its verb. nothing : what is shown where nothing is missing.
    """

    where: str
    healthy: str
    none: str
    named: str = "Shows"
    nothing: str = "nothing beyond a plain circuit"


CELL = Phrases(
    "on records that took no part in the fit",
    "the plain model (open-circuit voltage, a resistance, two RC pairs) is off by",
    "no effect of the vocabulary",
)
BASES = {
    "plain": CELL,
    "own": CELL._replace(healthy="the model in use is off by", named="The model in use lacks"),
    "external": CELL._replace(healthy="your model is off by", named="Your model lacks"),
}
GROUP = Phrases(
    "in branch currents (each times its cell's resistance) of tests that took no part in the fit",
    "healthy cells within the declared spread are off by",
    "no effect of one branch",
    nothing="no branch that differs by more than healthy cells do",
)
BLIND_GROUP = GROUP._replace(where="in the group's voltage of tests that took no part in the fit")
BLIND = (
    "Branch currents were not logged, and the group's voltage alone tells no branch from another: "
    "a name is only what would explain that voltage, and a fault of a branch's sensor cannot show."
)


def name_of_effect(effect, library=KNOWN):
    """An effect's short name in words; of one that has none, its id.

    Parameters
    ----------
    effect : id, or an answer that is none. library : dict of Effect by id, asked first.
    """
    entry = library.get(effect) or KNOWN.get(effect)
    in_words = effect.removeprefix("branch_").replace("_", " ")
    return (entry.short if entry else ANSWERS.get(effect)) or in_words


def phrases_of(verdict):
    """How a verdict is spoken of: that of a group says whether branch currents were logged."""
    if "branch_currents" in verdict:
        return GROUP if verdict["branch_currents"] else BLIND_GROUP
    return BASES[verdict.get("base") or "plain"]


def one_line(verdict, own=None, external=None):
    """What a cell shows, and what the model in use and that of the user lack, in one line.

    Parameters
    ----------
    verdict : dict of the contract, of the plain circuit. own, external : dict, of the model in
    use and of the user's simulator, or None.

    Returns
    -------
    line : str, without a full stop.
    """
    lacking = (("its model", own), ("your simulation", external))
    lacks = [_lacks(model, other) for model, other in lacking if other is not None]
    return "; ".join([_shows(verdict), *lacks])


NOTHING = "lacks nothing above"
FAR = 2.0  # times what a model is said to lack: a test in which it errs by more contradicts that


def beside_worst_test(line, volt_by_test):
    """The line of a cell, and the test in which its model errs by far more than it lacks.

    A search frees the start and the current of a record, and leaves out what it cannot place: that
    a model lacks nothing there says nothing of such a test.

    Parameters
    ----------
    line : from `one_line`. volt_by_test : dict, name of the test → rms error of the model in use.

    Returns
    -------
    line : str; the same one where no test contradicts it.
    """
    said = re.search(rf"its model {NOTHING} ([\d.e+-]+) mV", line)
    worst = max(volt_by_test, key=volt_by_test.get, default=None)
    if not said or worst is None or volt_by_test[worst] <= FAR * 1e-3 * float(said[1]):
        return line
    return f"{line}, yet errs by {millivolt(volt_by_test[worst])} in {worst}"


def _shows(verdict):
    names = _listed(_name(one) for one in verdict["effects"])
    if verdict["verdict"] == "none":
        return f"shows {phrases_of(verdict).nothing}"
    if not names:
        return f"shows {_without_name(verdict, _open(verdict))}"
    return f"shows {names}"


def _lacks(model, own):
    names = _listed(_name(one) for one in own["effects"])
    if own["verdict"] == "none":
        most = own["validation_rmse_volt"]["after"]
        return f"{model} {NOTHING} {1e3 * most:.2g} mV"
    if names:
        return f"{model} lacks {names}"
    # Freed to follow the records fitted, a model may err by more than it does as it is.
    left = _open(own)
    most = min(left, (own.get("as_given_rmse_volt") or {}).get("validation", left))
    return f"{model} lacks {_without_name(own, most)}"


def _without_name(verdict, volt):
    """What is unknown: how large, where, and what outside the vocabulary it looks like."""
    like = [name_of_effect(one["effect"]) for one in verdict.get("outside") or []]
    seems = f", which looks like {_listed(like)}" if like else ""
    return f"something without a name, {millivolt(volt)}{_in_place(verdict)}{seems}"


def _open(verdict):
    """Error without a name [V]: on records for proof or fitted, whichever is larger."""
    after = verdict["validation_rmse_volt"]["after"]
    return max(after, (verdict.get("remainder") or {}).get("excess_volt", 0.0))


def _in_place(verdict):
    place = _located(verdict)
    return f" {near(place)}" if place else ""


def _located(verdict):
    return (verdict.get("remainder") or {}).get("located_at") or verdict["located_at"]


def _name(one, library=KNOWN):
    names = [name_of_effect(name, library) for name in (one["effect"], *one["alternatives"])]
    text = " or ".join(dict.fromkeys(names)) + _branch(one)
    return f"{text} (unproven)" if one.get("proof") == "unproven" else text


def _branch(one):
    return f" (branch {one['branch']})" if "branch" in one else ""


def _listed(names):
    names = list(names)
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def paragraph(verdict, library):
    """A paragraph for people about one cell or group.

    Parameters
    ----------
    verdict : dict, as `verdict.verdict_of` makes it. Of its fields base, remainder, nuisances,
        floors, worsened, outside, against and, of an effect, sizes, proof and probability, each is
        told where it is there. library : dict of Effect by id.

    Returns
    -------
    text : str, a line for each sentence of `sentences_by_part`.
    """
    return "\n".join(text for _, text in sentences_by_part(verdict, library))


def sentences_by_part(verdict, library):
    """Sentences for people about one cell or group, each with the part of the story it is of.

    Parameters
    ----------
    verdict, library : as of `paragraph`.

    Returns
    -------
    sentences : list of (part, sentence); part is gap (before and after), names (each effect and its
        size), changes (for the user), left (where), sure (what speaks against it, and how likely)
        or next (test).
    """
    phrases = phrases_of(verdict)
    opening = {"none": _none, "unknown": _unknown}.get(verdict["verdict"], _named)
    parts = [
        *opening(verdict, library, phrases),
        *_of("gap", [*_worsened(verdict), *_as_given(verdict)]),
        *_of("names", [*_nameless(verdict, library), *_errors(verdict)]),
        *_of("names", _contradicted(verdict, library)),
        *_of("left", [*_gap(verdict), *_remainder(verdict), *_outside(verdict)]),
        *_of("sure", _declared_values_at_limit(verdict.get("nuisances") or [])),
        *_of("sure", [BLIND] if phrases is BLIND_GROUP else []),
    ]
    if verdict["next_test"]:
        advice = verdict["next_test"].rstrip(".")
        advice = advice.removeprefix("To ") if advice.startswith("To ") else advice
        parts.append(("next", f"To test next: {advice}."))
    return parts


def _of(part, sentences):
    return [(part, sentence) for sentence in sentences]


def _nameless(verdict, library):
    """What is in the model beside the names, and why it is none."""
    known = verdict.get("against") or {}
    small = verdict.get("small") or []
    listed = [f"{name_of_key(one, library)} ({known[one]})" for one in small]
    if not listed:
        return []
    return [f"In the model without a name: {_listed(listed)}."]


def _errors(verdict):
    """Errors of an unknown's models beside each other, where the names are not the whole model."""
    errors = verdict.get("errors")
    if verdict["verdict"] != "unknown" or not errors or not verdict.get("small"):
        return
    known = (
        ("plain", "the plain model"),
        ("names", "with its names"),
        ("model", "with all of this"),
    )
    told = [f"{millivolt(errors[key]['validation_volt'])} {words}" for key, words in known]
    yield f"On the records that were not fitted: {', '.join(told)}."


def _contradicted(verdict, library):
    """What the records ask for and another measurement of the cell rules out: both numbers."""
    for one in verdict.get("contradicted") or []:
        name, unit = name_of_effect(one["effect"], library), one["unit"]
        searched = in_words(one["searched"], unit, one["searched_std"])
        measured = in_words(one["measured"], unit, one["measured_std"])
        yield (
            f"Not named, although the drives ask for it: {name}, {searched} by the search. "
            f"Another measurement of this cell contradicts it: {measured} "
            f"({one['measurement']}: {one['quantity']})."
        )


def name_of_key(key, library=KNOWN):
    """Short name of an effect by its key: of a group with the branch, the first of which is 1."""
    effect, _, position = key.removesuffix("]").partition("[")
    return name_of_effect(effect, library) + (f" of branch {int(position) + 1}" if position else "")


def _as_given(verdict):
    """What a given model errs by before any of its parameters is freed."""
    given = verdict.get("as_given_rmse_volt")
    if given is None:
        return
    now = verdict["validation_rmse_volt"]["before"]
    text = (
        f"As it is, with no parameter freed, it is off by {millivolt(given['fit'])} on the records "
        f"fitted and by {millivolt(given['validation'])} on the others"
    )
    if now > BENT * given["validation"]:
        text += "; freed to follow the records fitted, by more on the others"
    yield f"{text}."


def _none(verdict, library, phrases):
    both = verdict["validation_rmse_volt"]["before"]
    text = (
        f"Nothing is missing that these data could show: {phrases.where} {phrases.healthy} "
        f"{millivolt(both)}, and {_floor(verdict)}."
    )
    return [("gap", text)]


def _floor(verdict):
    """What would be there anyway: by noise, and where it is known by the declared tolerances."""
    volts = sorted(one["volt"] for one in verdict.get("floors") or [])
    if not volts:
        return f"the noise alone is {millivolt(verdict['floor_volt'])}"
    ends = dict.fromkeys(millivolt(volt) for volt in (volts[0], volts[-1]))
    return f"noise and declared tolerances may leave {' to '.join(ends)} in a record"


# By samples, as errors count, long rests would hide what a short load shows.
EACH = ", each part of the records counted alike"


def _unknown(verdict, library, phrases):
    both = verdict["validation_rmse_volt"]
    text = (
        f"Something is missing that has no name here: {phrases.where} {phrases.healthy} "
        f"{millivolt(both['before'])}, and {_floor(verdict)}"
    )
    if not verdict["partial"]:
        found = "can be named for it" if verdict.get("small") else "explains it"
        return [("gap", f"{text}; {phrases.none} {found}.")]
    names, many = _listed(_name(one, library) for one in verdict["partial"]), verdict["partial"]
    known = verdict.get("remainder")
    left = f": {millivolt(known['excess_volt'])} are left beyond that{EACH}" if known else ""
    explain = "explain" if len(many) > 1 else "explains"
    text += f". {names[0].upper()}{names[1:]} {explain} a part of it{left}, too much for a name."
    return [("gap", text)]


def _named(verdict, library, phrases):
    both, named = verdict["validation_rmse_volt"], verdict["effects"]
    names = _listed(_name(one, library) for one in named)
    after = millivolt(both["after"])
    alone = (verdict.get("errors") or {}).get("names")
    by_names = millivolt(alone["validation_volt"]) if alone else after
    if verdict.get("small") and by_names != after:
        after = f"{by_names} ({after} with what is in the model without a name)"
    change = (
        f"{'together they take' if len(named) > 1 else 'it takes'} the error {phrases.where} from "
        f"{millivolt(both['before'])} to {after}"
    )
    if not both["after"] < both["before"]:
        change = (
            f"but the error {phrases.where} does not fall: {millivolt(both['before'])} before, "
            f"{millivolt(both['after'])} after"
        )
    elif len(named) == 1 and not falls_by_itself(named[0]):
        change = (
            f"the error {phrases.where} falls from {millivolt(both['before'])} to {after}, but by "
            "what was fitted beside this effect, not by it"
        )
    place = _located(verdict)
    left = f"; what is left sits {near(place)}" if place else ""
    changes = [library[one["effect"]].consequence for one in named]
    changes = "; ".join(dict.fromkeys(filter(None, changes)))
    return [
        ("gap", f"{phrases.named} {names}: {change}{left}. Of this, {_floor(verdict)}."),
        *_of("names", (_effect(one, library) for one in named)),
        *_of("changes", [f"What it changes: {changes}."] if changes else []),
    ]


def falls_by_itself(one):
    """Whether an effect of a verdict lowers the error of records that it was not fitted to."""
    both = one["validation_rmse_volt"]
    return both["after"] < both["before"]


def _effect(one, library):
    """One effect: what it is, its sizes, what it cannot be told from, and what makes it unsure."""
    effect = library[one["effect"]]
    known = one.get("sizes")
    sizes = [Size(**size) for size in known] if known else sizes_as_used(effect, one["parameters"])
    sizes = ", ".join(size.text for size in sizes)
    place = f"in branch {one['branch']} ({one['cell']}) " if "branch" in one else ""
    text = f"{place}{effect.sentence}"
    text = f"{text[0].upper()}{text[1:]} ({sizes})."
    if one["alternatives"]:
        others = " or ".join(library[name].sentence for name in one["alternatives"])
        text += f" These data cannot tell it from: {others}."
    if one.get("branch_alternatives"):
        others = " or ".join(str(branch) for branch in one["branch_alternatives"])
        text += f" As well it could be branch {others}."
    why = doubts(one)
    return f"{text} Unsure: {'; '.join(why)}." if why else text


def doubts(one, witnesses=()):
    """What speaks against trusting an effect of a verdict; empty where it is sure.

    Parameters
    ----------
    one : dict, entry of a verdict. witnesses : of this effect: sequence of dict with name, says
        and shown; one that shows the effect with another size is no doubt of its name.

    Returns
    -------
    reasons : tuple of str.
    """
    bounds = [name.replace("_", " ") for name, p in one["parameters"].items() if p["at_bound"]]
    likely = one.get("probability", 1.0)
    against = [w["name"] for w in witnesses if w["says"] == "contradicts" and not w["shown"]]
    reasons = (
        (one["alternatives"] or one.get("branch_alternatives"), "another explains it as well"),
        (
            one.get("proof") == "unproven",
            "records that were not fitted do not show it by themselves",
        ),
        (not falls_by_itself(one), "the error on records for proof does not fall"),
        (likely < SURE, f"of names beside another {100 * likely:.0f} % are right"),
        (bounds, f"{_listed(bounds)} ended on a bound"),
        (against, f"contradicted by {_listed(against)}"),
    )
    return tuple(text for holds, text in reasons if holds)


def _gap(verdict):
    """Where a group erred before, which has no map of its errors."""
    place = verdict.get("gap_at")
    if place is None:
        return []
    share = f"{100 * place['share']:.0f} %"
    return [f"The largest part of the gap, {share}, sat {where(place)}."]


def _remainder(verdict):
    left, place = verdict.get("remainder"), verdict["located_at"]
    parts = []
    if place is not None:
        share = f"{100 * place['share']:.0f} %, sits {where(place)}"
        parts.append(f"The largest part of what is left, {share}.")
    if not left:
        return parts
    left = millivolt(left["excess_volt"])
    return [*parts, f"Left beyond what noise and declared tolerances allow: {left}{EACH}."]


def _worsened(verdict):
    fields = (verdict.get("worsened") or [])[:SHOWN_WORSE]
    if not fields or not verdict["effects"]:
        return []
    listed = _listed(f"by {millivolt(one['volt'])} {where(one)}" for one in fields)
    more = len(verdict["worsened"]) - len(fields)
    return [f"Worse than before {listed}{f', and in {more} more places' if more else ''}."]


def _outside(verdict):
    """What the records show that the vocabulary has no name for, and is not in the model."""
    for one in verdict.get("outside") or []:
        unit, factor = UNIT_IN_WORDS.get(one["unit"], (one["unit"], 1.0))
        size = Size("", factor * one["value"], factor * one["std"], unit).text.strip()
        both = one["validation_rmse_volt"]
        yield (
            f"What is left looks like {name_of_effect(one['effect'])} ({size}), which has no name "
            f"in the vocabulary and is not in the model: with it the error would be "
            f"{millivolt(both['after'])} in place of {millivolt(both['before'])}."
        )


def _declared_values_at_limit(nuisances):
    """What the model takes otherwise than was declared, at the limit or beyond."""
    starts = [one["test"] for one in nuisances if one["name"] == "soc_at_start"]
    beyond = [_beyond(one) for one in nuisances if one["name"] != "soc_at_start"]
    if starts:
        more = len(starts) - SHOWN_STARTS
        tests = [*starts[:SHOWN_STARTS], *([f"{more} more"] if more > 0 else [])]
        beyond.append(
            f"the SoC at the start of {_listed(tests)} is at the limit that rest and sheet allow"
        )
    if not beyond:
        return []
    return [
        f"Off what was declared: {'; '.join(beyond)}. That stands in for what the model lacks, "
        "or it was declared wrongly."
    ]


def _beyond(one):
    if one["unit"] == "K":
        way, by = "warmer" if one["value"] > 0 else "colder", abs(one["value"])
        wrong = f"{one['test']} was {by:.1f} K {way} than the sheet states"
        return f"{wrong} (no sensor told; tolerance {one['prior_std']:g} K)"
    way = "above" if one["value"] > 0 else "below"
    in_words = millivolt if one["unit"] == "V" else _percent
    size, tolerance = in_words(abs(one["value"])), in_words(one["prior_std"])
    moved = f"the capacity {size} {way} the measured one"
    if one["unit"] == "V":
        moved = f"the open-circuit voltage at {100 * one['soc']:.0f} % SoC {size} {way} its curve"
    sure = "as far as it may" if one["std"] is None else f"± {in_words(one['std'])}"
    return f"{moved} ({sure}; tolerance {tolerance})"


def _percent(share):
    return f"{100 * share:.2g} %"
