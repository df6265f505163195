"""Why a cell has no model, in words that name what would give it one."""

import pytest
from sheets_facts import facts_of

from cellwright.identification.lacking import why_no_model


@pytest.mark.parametrize(
    ("tests", "words"),
    [
        ([], "the sheet has no test of this cell"),
        (
            [facts_of("d", "drive", role="validation")],
            r"by their role: d \(validation\); a test of kind drive is fitted as fit or split",
        ),
        (
            [facts_of("a", "ageing"), facts_of("b", "ageing"), facts_of("e", "eis")],
            r"of its tests \(2 ageing, 1 eis\) none is of pulses \(hppc\) or drives \(drive\) or ",
        ),
        ([facts_of("q", "capacity")], r"loads at one rate only, as far as the sheet tells \(q\)"),
    ],
)
def test_what_is_missing_is_named(tests, words):
    import re

    said = why_no_model(tests)
    assert said.startswith("no model: ")
    assert re.search(words, said)


def test_an_ocv_is_asked_for_only_where_there_is_none():
    missing = "no slow test (ocv) of it or of a cell of its type"
    load, slow = facts_of("q", "capacity"), facts_of("o", "ocv")
    assert missing in why_no_model([load])
    assert missing not in why_no_model([load], lent=True)
    assert missing not in why_no_model([slow])
