"""Which question of a verdict the next test is to answer."""

from cellwright.effects.verdict import NO_SIZE, is_proven, shown_outside


def advised(found, result, library, untestable, place):
    """The most urgent open question of a verdict.

    1. A tie: which of the effects it is.
    2. A name that the validation records do not show by themselves: its proof.
    3. What the vocabulary has no name for, or of an unknown what is in its model and has no name
       because the records do not tell its size: the test that shows it.
    4. A gap that is larger than anyone would accept: the test in which most of it sits, again, with
       rests before and after.
    5. Nothing missing: whether an effect is that most cells have and the records could not show
       (`Effect.asked_if_unseen`).

    Parameters
    ----------
    found : search.Search of a cell. result : verdict.Outcome of it.
    library : dict of Effect by id. untestable : ids that the records cannot show.
    place : dict, see `judge.worst`; None: unknown.

    Returns
    -------
    question : dict of code ("tell_apart", "prove", "see", "see_size" or "place"), effect and
        alternatives, ids, and place; None: there is none. `words.next_test` words it.
    """
    tied = next((one for one in result.names if one.tied), None)
    if tied is not None:
        return question("tell_apart", tied.effect.id, tied.tied)
    unproven = next((one for one in result.names if not is_proven(found, one)), None)
    if unproven is not None:
        return question("prove", unproven.effect.id)
    for one in shown_outside(found, result):
        return question("see", one.effect.id)
    unsized = [one for one, why in result.unnamed if why == NO_SIZE]
    if result.word == "unknown" and unsized:
        return question("see_size", max(unsized, key=lambda one: one.gain.total).effect.id)
    if not result.adequate:
        return None if place is None else question("place", place=place)
    unseen = (name for name in untestable if library[name].asked_if_unseen)
    name = next(unseen, None) if result.word == "none" else None
    return None if name is None else question("see", name)


def question(code, effect=None, alternatives=(), place=None):
    """A question that a test can answer, as a verdict holds it; see `advised`."""
    return {"code": code, "effect": effect, "alternatives": list(alternatives), "place": place}


def ways_to_tell(effect, alternatives, library):
    """Tests that tell an effect from its alternatives, or that show it: tuple of clauses.

    A structural tie says what tells its two effects apart; without one each effect says which test
    shows it best.

    Parameters
    ----------
    effect : id. alternatives : ids. library : dict of Effect by id.
    """
    ids = {effect, *alternatives}
    ties = [(tie, {name, tie.partner}) for name in library for tie in library[name].ties]
    if alternatives:
        checks = [tie.check for tie, pair in ties if effect in pair and pair <= ids]
    else:  # what no record of the cell shows
        checks = [tie.check for tie in library[effect].ties if tie.always and tie.exact]
    shows = [library[name].shows for name in (effect, *alternatives)]
    return tuple(dict.fromkeys(checks or shows))
