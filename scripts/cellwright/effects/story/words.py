"""A verdict in words, for a reader who knows no statistics: one sentence first, then the rest."""

from cellwright.effects.advice import ways_to_tell
from cellwright.effects.library import known_effects
from cellwright.effects.story.messages import say
from cellwright.effects.story.places import millivolt, near, where
from cellwright.effects.story.sizes import Size, sizes_as_used
from cellwright.effects.witnesses.statement import in_words
from cellwright.messages import listed

KNOWN = {effect.id: effect for effect in known_effects()}
ANSWERS = ("none", "unknown")  # of a search, that are no effect
BENT = 1.1  # times its error as it is, beyond which a given model was bent by the records fitted
SURE = 0.9  # probability of a name from which on it is sure
SHOWN_WORSE, SHOWN_STARTS = 2, 3
FAR = 2.0  # times what a model is said to lack: a test in which it errs by more contradicts that
# Units of sizes outside the vocabulary in words, and over those of the verdict.
UNIT_IN_WORDS = {"1/h": ("% in an hour", 1e2)}


def name_of_effect(effect, library=KNOWN):
    """An effect's short name in words; of one that has none, its id.

    Parameters
    ----------
    effect : id, or an answer that is none. library : dict of Effect by id, asked first.
    """
    if effect in ANSWERS:
        return say(f"answer.{effect}")
    entry = library.get(effect) or KNOWN.get(effect)
    return (entry and entry.short) or effect.removeprefix("branch_").replace("_", " ")


def name_of_key(key, library=KNOWN):
    """Short name of an effect by its key: of a group with the branch, the first of which is 1."""
    effect, _, position = key.removesuffix("]").partition("[")
    return name_of_effect(effect, library) + (f" of branch {int(position) + 1}" if position else "")


def base_of(verdict):
    """What was searched: "plain", "own" or "external" model, or a "group"."""
    return "group" if "branch_currents" in verdict else verdict.get("base") or "plain"


def _is_blind(verdict):
    """Whether a group's branch currents were not logged."""
    return not verdict.get("branch_currents", True)


def _searched(verdict):
    """Fields of a sentence on the gap: the model without effects, where it errs, and the floor."""
    group = "group_blind" if _is_blind(verdict) else "group"
    base = base_of(verdict)
    where_errs = say(f"where.{group if base == 'group' else 'cell'}")
    return {"healthy": say(f"base.{base}"), "where": where_errs, "floor": _floor(verdict)}


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
    if verdict["verdict"] == "none":
        shown = say(f"base.{base_of(verdict)}_nothing")
    else:
        shown = _names(verdict) or _without_name(verdict, _open(verdict))
    lacking = {"own": own, "external": external}
    lacks = [_lacks(say(f"line.{key}"), one) for key, one in lacking.items() if one is not None]
    return "; ".join([say("line.shows", what=shown), *lacks])


def lacks_nothing_above(own):
    """Error [V] above which the model in use lacks nothing; None where something is missing.

    Parameters
    ----------
    own : dict, verdict on the model in use, or None.
    """
    nothing = own is not None and own["verdict"] == "none"
    return own["validation_rmse_volt"]["after"] if nothing else None


def beside_worst_test(line, above_volt, volt_by_test):
    """The line of a cell, and the test in which its model errs by far more than it lacks.

    A search frees the start and the current of a record, and leaves out what it cannot place: that
    a model lacks nothing there says nothing of such a test.

    Parameters
    ----------
    line : from `one_line`. above_volt : see `lacks_nothing_above`.
    volt_by_test : dict, name of the test → rms error of the model in use.

    Returns
    -------
    line : str; the same one where no test contradicts it.
    """
    test = max(volt_by_test, key=volt_by_test.get, default=None)
    if above_volt is None or test is None or volt_by_test[test] <= FAR * above_volt:
        return line
    return say("line.yet_errs", line=line, volt=millivolt(volt_by_test[test]), test=test)


def _lacks(model, own):
    if own["verdict"] == "none":
        return say("line.lacks_nothing", model=model, milli=1e3 * lacks_nothing_above(own))
    # Freed to follow the records fitted, a model may err by more than it does as it is.
    left = _open(own)
    most = min(left, (own.get("as_given_rmse_volt") or {}).get("validation", left))
    return say("line.lacks", model=model, what=_names(own) or _without_name(own, most))


def _without_name(verdict, volt):
    """What is unknown: how large, where, and what outside the vocabulary it looks like."""
    place = _located(verdict)
    fields = {"volt": millivolt(volt)} | ({"near": near(place)} if place else {})
    unknown = say("line.unknown_near" if place else "line.unknown", **fields)
    like = [name_of_effect(one["effect"]) for one in verdict.get("outside") or []]
    return say("line.looks_like", unknown=unknown, like=listed(like)) if like else unknown


def _open(verdict):
    """Error without a name [V]: on records for proof or fitted, whichever is larger."""
    after = verdict["validation_rmse_volt"]["after"]
    return max(after, (verdict.get("remainder") or {}).get("excess_volt", 0.0))


def _located(verdict):
    return (verdict.get("remainder") or {}).get("located_at") or verdict["located_at"]


def _names(verdict, library=KNOWN, of="effects"):
    """Names of the effects of a verdict, each with what it is as good as."""
    return listed(_name(one, library) for one in verdict[of])


def _name(one, library=KNOWN):
    names = [name_of_effect(name, library) for name in (one["effect"], *one["alternatives"])]
    text = " or ".join(dict.fromkeys(names))
    if "branch" in one:
        text = say("names.branch", name=text, branch=one["branch"])
    return say("names.unproven", name=text) if one.get("proof") == "unproven" else text


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
    gap = {"none": _none, "unknown": _unknown}.get(verdict["verdict"], _named)
    named = verdict["effects"] if gap is _named else ()
    effects = [library[one["effect"]] for one in named]
    changes = "; ".join(dict.fromkeys(filter(None, (one.consequence for one in effects))))
    story = {
        "gap": [gap(verdict, library), *_worsened(verdict), *_as_given(verdict)],
        "names": [
            *(_effect(one, library) for one in named),
            *_small(verdict, library),
            *_errors(verdict),
            *_contradicted(verdict, library),
        ],
        "changes": [say("names.changes", changes=changes)] if changes else [],
        "left": [*_left(verdict), *_outside(verdict)],
        "sure": [*_declared(verdict), *([say("sure.blind")] if _is_blind(verdict) else [])],
        "next": [verdict["next_test"]] if verdict["next_test"] else [],
    }
    return [(part, sentence) for part, sentences in story.items() for sentence in sentences]


def next_test(question, library):
    """The next test in words, as a sentence; None where there is no question.

    Parameters
    ----------
    question : dict of `advice.advised`, or None. library : dict of Effect by id.
    """
    if question is None:
        return None
    if question["code"] == "place":
        return say("next.place", where=where(question["place"]))
    effect, others, known = question["effect"], question["alternatives"], KNOWN | library
    return say(
        f"next.{question['code']}",
        effect=name_of_effect(effect, known),
        sentence=known[effect].sentence,
        others=" or ".join(name_of_effect(one, known) for one in others),
        tests=say("next.and_test").join(ways_to_tell(effect, others, known)),
    )


def _small(verdict, library):
    """What is in the model beside the names, and why it is none."""
    why = verdict.get("against") or {}
    small = [
        say("names.small_one", name=name_of_key(one, library), why=say(f"against.{why[one]}"))
        for one in verdict.get("small") or []
    ]
    return [say("names.small", listed=listed(small))] if small else []


def _errors(verdict):
    """Errors of an unknown's models beside each other, where the names are not the whole model."""
    errors = verdict.get("errors")
    if verdict["verdict"] != "unknown" or not errors or not verdict.get("small"):
        return
    kinds = ("plain", "names", "model")
    yield say("names.errors", **{k: millivolt(errors[k]["validation_volt"]) for k in kinds})


def _contradicted(verdict, library):
    """What the records ask for and another measurement of the cell rules out: both numbers."""
    for one in verdict.get("contradicted") or []:
        yield say(
            "names.contradicted",
            name=name_of_effect(one["effect"], library),
            searched=in_words(one["searched"], one["unit"], one["searched_std"]),
            measured=in_words(one["measured"], one["unit"], one["measured_std"]),
            measurement=one["measurement"],
            quantity=one["quantity"],
        )


def _as_given(verdict):
    """What a given model errs by before any of its parameters is freed."""
    given = verdict.get("as_given_rmse_volt")
    if given is None:
        return
    bent = verdict["validation_rmse_volt"]["before"] > BENT * given["validation"]
    code = "gap.as_given_bent" if bent else "gap.as_given"
    yield say(code, **{side: millivolt(volt) for side, volt in given.items()})


def _floor(verdict):
    """What would be there anyway: by noise, and where it is known by the declared tolerances."""
    volts = sorted(one["volt"] for one in verdict.get("floors") or [])
    if not volts:
        return say("gap.floor_noise", volt=millivolt(verdict["floor_volt"]))
    low, high = millivolt(volts[0]), millivolt(volts[-1])
    return say("gap.floor_one" if low == high else "gap.floor_range", low=low, high=high)


def _none(verdict, library):
    before = millivolt(verdict["validation_rmse_volt"]["before"])
    return say("gap.none", before=before, **_searched(verdict))


def _unknown(verdict, library):
    before = millivolt(verdict["validation_rmse_volt"]["before"])
    text = say("gap.unknown", before=before, **_searched(verdict))
    many = len(verdict["partial"])
    if not many:
        end = "unnamed" if verdict.get("small") else "unexplained"
        group = "group_" if base_of(verdict) == "group" else ""
        return f"{text} {say(f'gap.unknown_{group}{end}')}"
    names, left = _names(verdict, library, "partial"), verdict.get("remainder")
    code = "gap.unknown_part_one" if many == 1 else "gap.unknown_part_many"
    fields = {"names": names[0].upper() + names[1:]}
    if left:
        code = f"{code}_left"
        fields["left"] = millivolt(left["excess_volt"])
    return f"{text} {say(code, **fields)}"


def _named(verdict, library):
    both, named = verdict["validation_rmse_volt"], verdict["effects"]
    if not both["after"] < both["before"]:
        code = "rises"
    elif len(named) > 1:
        code = "many"
    else:
        code = "one" if falls_by_itself(named[0]) else "beside"
    after = millivolt(both["after"])
    alone = (verdict.get("errors") or {}).get("names")
    by_names = millivolt(alone["validation_volt"]) if alone else after
    if verdict.get("small") and by_names != after:
        after = say("gap.with_small", names=by_names, model=after)
    place = _located(verdict)
    return say(
        f"gap.named_{code}",
        shown=say(f"base.{base_of(verdict)}_named", names=_names(verdict, library)),
        before=millivolt(both["before"]),
        after=after,
        left=say("gap.left_near", near=near(place)) if place else "",
        **_searched(verdict),
    )


def falls_by_itself(one):
    """Whether an effect of a verdict lowers the error of records that it was not fitted to."""
    both = one["validation_rmse_volt"]
    return both["after"] < both["before"]


def _effect(one, library):
    """One effect: what it is, its sizes, what it cannot be told from, and what makes it unsure."""
    effect, known = library[one["effect"]], one.get("sizes")
    sizes = [Size(**size) for size in known] if known else sizes_as_used(effect, one["parameters"])
    sentence = effect.sentence
    if "branch" in one:
        sentence = say("names.in_branch", sentence=sentence, **{k: one[k] for k in BRANCH})
    sentence = sentence[0].upper() + sentence[1:]
    parts = [say("names.effect", sentence=sentence, sizes=", ".join(size.text for size in sizes))]
    if one["alternatives"]:
        others = " or ".join(library[name].sentence for name in one["alternatives"])
        parts.append(say("names.tied", others=others))
    if one.get("branch_alternatives"):
        parts.append(say("names.tied_branch", others=" or ".join(map(str, one[BRANCHES]))))
    if why := doubts(one):
        parts.append(say("names.unsure", reasons="; ".join(why.values())))
    return " ".join(parts)


BRANCH, BRANCHES = ("branch", "cell"), "branch_alternatives"


def doubts(one, witnesses=()):
    """What speaks against trusting an effect of a verdict; empty where it is sure.

    Parameters
    ----------
    one : dict, entry of a verdict. witnesses : of this effect: sequence of dict with name, says
        and shown; one that shows the effect with another size is no doubt of its name.

    Returns
    -------
    reasons : dict of code → clause; codes are tied, unproven, no_fall, beside, at_bound, witness.
    """
    bounds = [name.replace("_", " ") for name, p in one["parameters"].items() if p["at_bound"]]
    likely = one.get("probability", 1.0)
    against = [w["name"] for w in witnesses if w["says"] == "contradicts" and not w["shown"]]
    holds = {
        "tied": bool(one["alternatives"] or one.get(BRANCHES)),
        "unproven": one.get("proof") == "unproven",
        "no_fall": not falls_by_itself(one),
        "beside": likely < SURE,
        "at_bound": bool(bounds),
        "witness": bool(against),
    }
    fields = {"beside": {"share": 100 * likely}, "at_bound": {"names": listed(bounds)}}
    fields |= {"witness": {"names": listed(against)}}
    return {
        code: say(f"doubt.{code}", **fields.get(code, {})) for code, found in holds.items() if found
    }


def _left(verdict):
    """Where a group erred before, which has no map of its errors; what is left, and where."""
    for code, place in (("sat", verdict.get("gap_at")), ("located", verdict["located_at"])):
        if place is not None:
            yield say(f"left.{code}", share=100 * place["share"], where=where(place))
    if verdict.get("remainder"):
        yield say("left.excess", volt=millivolt(verdict["remainder"]["excess_volt"]))


def _worsened(verdict):
    fields = (verdict.get("worsened") or [])[:SHOWN_WORSE]
    if not fields or not verdict["effects"]:
        return []
    by_where = [
        say("gap.by_where", volt=millivolt(one["volt"]), where=where(one)) for one in fields
    ]
    more = len(verdict["worsened"]) - len(fields)
    code = "gap.worsened_more" if more else "gap.worsened"
    return [say(code, places=listed(by_where), more=more)]


def _outside(verdict):
    """What the records show that the vocabulary has no name for, and is not in the model."""
    for one in verdict.get("outside") or []:
        unit, factor = UNIT_IN_WORDS.get(one["unit"], (one["unit"], 1.0))
        size = Size("", factor * one["value"], factor * one["std"], unit).text.strip()
        both = {side: millivolt(volt) for side, volt in one["validation_rmse_volt"].items()}
        yield say("left.outside", name=name_of_effect(one["effect"]), size=size, **both)


def _declared(verdict):
    """What the model takes otherwise than was declared, at the limit or beyond."""
    nuisances = verdict.get("nuisances") or []
    beyond = [_beyond(one) for one in nuisances if one["name"] != "soc_at_start"]
    starts = [one["test"] for one in nuisances if one["name"] == "soc_at_start"]
    if starts:
        more = len(starts) - SHOWN_STARTS
        tests = [*starts[:SHOWN_STARTS], *([say("sure.more_tests", more=more)] * (more > 0))]
        beyond.append(say("sure.start", tests=listed(tests)))
    return [say("sure.declared", values="; ".join(beyond))] if beyond else []


def _beyond(one):
    """A declared capacity, point of the OCV, or temperature, and where the fit has it."""
    size, way = abs(one["value"]), say("sure.above" if one["value"] > 0 else "sure.below")
    if one["unit"] == "K":
        fields = {"test": one["test"], "tolerance": one["prior_std"]}
        return say("sure.temperature", size=size, way=way, **fields)
    in_unit = millivolt if one["unit"] == "V" else _percent
    held = one["std"] is None
    return say(
        f"sure.{one['name']}",
        size=in_unit(size),
        way=way,
        soc=100 * (one["soc"] or 0.0),
        sure=say("sure.as_far") if held else say("sure.std", std=in_unit(one["std"])),
        tolerance=in_unit(one["prior_std"]),
    )


def _percent(share):
    return f"{100 * share:.2g} %"
