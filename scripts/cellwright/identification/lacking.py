"""Why a cell has no model: what its tests lack, as the sheet of the campaign tells it."""

from collections import Counter

from cellwright.records import inputs
from cellwright.refusal import Refusal

FITTED = {"hppc": "pulses", "drive": "drives", "capacity": "constant-current loads"}
# Roles in which a test of each kind may be fitted; of `split` the odd blocks.
FIT_ROLES = {"hppc": ("fit",), "drive": ("fit", "split"), "capacity": ("fit",)}


def why_no_model(tests, *, lent=False):
    """What is missing for a model of a cell that has no pulses or drives to fit, in a sentence.

    Parameters
    ----------
    tests : list of TestFacts, all tests of the cell.
    lent : whether a cell of its chemistry and rating has an OCV curve to lend.

    Returns
    -------
    words : str.
    """
    if not tests:
        return "no model: the sheet has no test of this cell, and no cell of its type lends one"
    wanted = " or ".join(f"{words} ({kind})" for kind, words in FITTED.items())
    could_fit = [test for test in tests if test.kind in FITTED]
    reasons = [
        *_of_roles([test for test in could_fit if not _may_be_fitted(test)]),
        *_of_one_load([test for test in could_fit if _may_be_fitted(test)]),
    ]
    if not could_fit:
        kinds = ", ".join(f"{n} {kind}" for kind, n in Counter(t.kind for t in tests).items())
        reasons = [f"of its tests ({kinds}) none is of {wanted}, which models are fitted to"]
    if not lent and not any(test.kind == "ocv" for test in tests):
        reasons.append("no slow test (ocv) of it or of a cell of its type tells an OCV")
    names = ", ".join(test.test for test in tests)
    reasons = reasons or [f"none of its tests ({names}) could be laid out for a fit"]
    return f"no model: {'; '.join(reasons)}"


def refuse_model(tests, *, lent_curve=False):
    """Raise a Refusal that says what is missing for a model of a cell without a test to fit.

    tests : TestFacts or mappings. lent_curve : an OCV is lent.
    """
    facts = [*map(inputs.test_facts, tests)]
    raise Refusal(why_no_model(facts, lent=lent_curve))


def _may_be_fitted(test):
    return test.role in FIT_ROLES[test.kind]


def _of_roles(tests):
    for kind in dict.fromkeys(test.kind for test in tests):
        names = ", ".join(f"{t.test} ({t.role})" for t in tests if t.kind == kind)
        roles = " or ".join(FIT_ROLES[kind])
        yield f"not to be fitted by their role: {names}; a test of kind {kind} is fitted as {roles}"


def _of_one_load(tests):
    loads = [test.test for test in tests if test.kind == "capacity"]
    if loads:
        yield (
            f"loads at one rate only, as far as the sheet tells ({loads[0]}): they cannot tell OCV "
            "and resistance apart; wanted a test at a second rate at the same age, or a slow test"
        )
