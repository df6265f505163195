"""How often each name of a verdict stays when one record of the cell is left out of its search."""

from typing import NamedTuple

from cellwright.effects.finding import searched, task_of
from cellwright.effects.preparing import KINDS, SLOW_TEST
from cellwright.records.conditions import of_first_checkup
from cellwright.refusal import Refusal

FINDS = ("named", "ambiguous")  # words of a verdict that has names


class Repeat(NamedTuple):
    """One search of a cell.

    left_out : name of the test without which it was made; None: with all of them.
    role : of that test. verdict : the word, None where there could be no search.
    effects : ids in order of addition. alternatives : per effect, ids that explain as much.
    validation_volt : error on the records for proof before and after [V].
    reason : why there could be no search, else "".
    """

    left_out: str | None
    role: str | None
    verdict: str | None
    effects: tuple = ()
    alternatives: tuple = ()
    validation_volt: tuple = (None, None)
    reason: str = ""


class Stability(NamedTuple):
    """Repeats of a search, and how often each of its names stays.

    repeats : list of Repeat, that with all records first. rows : list of dict, one a name: effect;
        named_with_all, whether the search with all records names it; searches, how many without a
    record could be made; stays, in how many of these it is a name or tied with one; share, of
    them; told_by, the tests without which it is lost, or, of a name that all records together do
    not give, without which it appears.
    """

    repeats: list
    rows: list


def stability(cell, basis, tests, library, **options):
    """The search of a cell with each of its records left out in turn.

    Only the search is repeated: basis (OCV, capacity) and, of the base `own`, the model in use stay
    as all records made them, so that what changes is what the search makes of the records.

    Parameters
    ----------
    cell, basis, tests, library : as of `finding.missing_effect`. options : its further ones.

    Returns
    -------
    stability : Stability.

    Raises
    ------
    Refusal : the cell cannot be searched with all of its records; see `finding.missing_effect`.
    """
    slow = [test for test in tests if test.facts.kind == SLOW_TEST]
    records = of_first_checkup([test for test in tests if test.facts.kind in KINDS])[0]
    repeats = [_repeat(None, task_of(cell, basis, [*slow, *records], **options), library)]
    for test in records:
        others = [*slow, *(other for other in records if other is not test)]
        try:
            task = task_of(cell, basis, others, **options)
            repeats.append(_repeat(test.facts, task, library))
        except Refusal as refusal:
            facts = test.facts
            repeats.append(Repeat(facts.test, facts.role, None, reason=str(refusal)))
    return Stability(repeats, list(name_rows(repeats)))


def _repeat(facts, task, library):
    """One search: Repeat."""
    found, result, _ = searched(task.case, library)
    left_out, role = (facts.test, facts.role) if facts else (None, None)
    names = result.names if result.word in FINDS else ()
    return Repeat(
        *(left_out, role, result.word),
        tuple(one.effect.id for one in names),
        tuple(one.tied for one in names),
        (found.first.validation_rmse_volt, result.last.validation_rmse_volt),
    )


def name_rows(repeats):
    """A row for each name of any of the searches, those of the search with all records first.

    Parameters
    ----------
    repeats : list of Repeat, that with all records first.
    """
    whole, without = repeats[0], [r for r in repeats[1:] if r.verdict is not None]
    others = (name for repeat in without for name in repeat.effects)
    for name in dict.fromkeys((*whole.effects, *others)):
        named = name in whole.effects
        stays = [repeat for repeat in without if name in _possible(repeat)]
        telling = [r.left_out for r in without if (r in stays) != named]
        yield {
            "effect": name,
            "named_with_all": named,
            "searches": len(without),
            "stays": len(stays),
            "share": len(stays) / len(without) if without else None,
            "told_by": "; ".join(telling),
        }


def _possible(repeat):
    """Names of a search, and those tied with them."""
    return {*repeat.effects, *(name for tied in repeat.alternatives for name in tied)}


def repeat_rows(repeats):
    """Rows of the searches: left_out, role, verdict, effects, errors for proof [V], reason.

    Parameters
    ----------
    repeats : list of Repeat.
    """
    return [
        {
            "left_out": repeat.left_out,
            "role": repeat.role,
            "verdict": repeat.verdict,
            "effects": "; ".join(map(_with_ties, repeat.effects, repeat.alternatives)),
            "validation_before_volt": repeat.validation_volt[0],
            "validation_after_volt": repeat.validation_volt[1],
            "reason": repeat.reason,
        }
        for repeat in repeats
    ]


def _with_ties(name, tied):
    return " or ".join([name, *tied])
