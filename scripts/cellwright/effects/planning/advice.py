"""Which question of a verdict the next test is to answer."""

from cellwright.effects.planning.planner import next_test
from cellwright.effects.story.places import where
from cellwright.effects.verdict import NO_SIZE, is_proven, shown_outside

REST_HOUR = 1  # before and after the loads of a test that is repeated
NEARER = 3  # effects that are fitted beside what a search has found
NEAR = 0.25  # share of the squared gap that an explanation near enough to be tested takes
DOUBLED = 2.0  # what a test makes of the chi-square on hand: explanations told apart are both wrong


def advised(found, result, library, untestable, place):
    """Menu of next tests and advice of one, for the most urgent open question.

    1. A tie: what tells the effects apart, where one of the menu at least doubles what the records
       say. Where none does, the model follows neither well enough, and 4 is asked.
    2. A name that the records that judge do not show by themselves: the same of its proof.
    3. What the vocabulary has no name for, or of an unknown what is in its model and has no name
       because the records do not tell its size: the test that shows it.
    4. A gap that is larger than anyone would accept: what tells the two nearest explanations of it
       apart, or would prove the only one, where they take a quarter of the gap and a test of the
       menu at least doubles what the records on hand say. Else the test in which most of the gap
       sits, again, with rests before and after.
    5. Nothing missing: whether an effect is that most cells have and the records could not show
       (`Effect.asked_if_unseen`).

    Parameters
    ----------
    found : search.Found of a cell. result : verdict.Outcome of it.
    library : dict of Effect by id. untestable : ids that the records cannot show.
    place : dict, see `judge.worst`; None: unknown.

    Returns
    -------
    menu : dict of columns test, hours, chi_square; {} where nothing of the menu was weighed.
    sentence : str, or None: there is no open question. test : id of the menu that is advised, or
    None.
    """
    case = found.case
    tied = next((one for one in result.names if one.tied), None)
    if tied is not None:
        state, name = tied.state, tied.effect.id
        advice = next_test(case, state, name, tied.tied, library=library)
        if _doubles(advice):
            return _advice_of(advice)
    asked = next((one for one in result.names if not is_proven(found, one)), None)
    if asked is not None:
        advice = next_test(case, result.last, asked.effect.id, library=library, proof=True)
        if _doubles(advice):
            return _advice_of(advice)
    for one in shown_outside(found, result):
        return {}, f"To see whether {one.effect.sentence}: {one.effect.shows}.", None
    unsized = [one for one, why in result.unnamed if why == NO_SIZE]
    if result.word == "unknown" and unsized:
        effect = max(unsized, key=lambda one: one.gain.total).effect
        return {}, f"To see by how much {effect.sentence}: {effect.shows}.", None
    if not result.adequate:
        return _of_gap(found, result, library, place)
    unseen = (name for name in untestable if library[name].asked_if_unseen)
    name = next(unseen, None) if result.word == "none" else None
    if name is None:
        return {}, None, None
    return _advice_of(next_test(case, result.last, name, library=library))


def _advice_of(advice):
    """Menu, sentence and test of an Advice, as `advised` returns them."""
    return advice.table, advice.sentence, None if advice.test == "check" else advice.test


def _of_gap(found, result, library, place):
    """Advice on what is left after the search: on its nearest explanations, or on its place."""
    case, near = found.case, found.nearest(NEARER)
    near = [one for one in near if _near(found.last, one.state, result.floor)][:2]
    if near:
        state, (name, *rivals) = near[0].state, [_added(found, one) for one in near]
        advice = next_test(case, state, name, tuple(rivals), library=library, proof=not rivals)
        if _doubles(advice):
            sentence = f"{advice.sentence[:-1]}. Neither explains all that is left."
            return advice.table, sentence, advice.test
    if place is None:
        return {}, None, None
    rest = f"{REST_HOUR} h of rest before and after"
    sentence = (
        f"To see what is left {where(place)}: the loads of that test once more in this range of "
        f"the state of charge, with {rest}, as a test that is not fitted."
    )
    return {}, sentence, None


def _doubles(advice):
    """Whether a test of the menu tells much more than the records on hand do, or a check would."""
    if advice.test in (None, "check"):
        return advice.test == "check"
    return max(advice.table["chi_square"]) >= DOUBLED * advice.now


def _added(found, model):
    """Id of the effect that a model has beside those of the search's own."""
    inside = {effect.key for effect in found.model.effects}
    return next(effect.id for effect in model.effects if effect.key not in inside)


def _near(before, after, floor):
    """Whether a model takes a fair part of what another leaves."""
    sides = (
        (before.rmse_volt, after.rmse_volt, floor.fit_volt),
        (before.validation_rmse_volt, after.validation_rmse_volt, floor.validation_volt),
    )
    was, now, least = max(sides, key=lambda side: side[0] ** 2 - side[2] ** 2)
    return was**2 - now**2 >= NEAR * (was**2 - least**2)
