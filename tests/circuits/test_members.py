"""Names of members: what each letter asks for, and what is no name."""

import pytest

from cellwright.circuits.circuit import Member, member_named
from cellwright.refusal import Refusal


@pytest.mark.parametrize(
    ("name", "member"),
    [
        ("0RC", (0, False, False, False)),
        ("4RC", (4, False, False, False)),
        ("2RC+H", (2, True, False, False)),
        ("DRT", (None, False, False, False)),
        ("DRT+K", (None, False, True, False)),
        ("DRT+D+H", (None, True, False, True)),
        ("DRT+H+K+D", (None, True, True, True)),
    ],
)
def test_a_name_says_what_a_member_holds(name, member):
    assert member_named(name) == Member(name, *member)


@pytest.mark.parametrize(
    "name", ["", "5RC", "RC", "2rc", "DRT+", "DRT+X", "2RC+H+H", "+H", "2RC H", "2RC\n"]
)
def test_other_names_are_refused(name):
    with pytest.raises(Refusal, match="is unknown; allowed are 0RC … 4RC or DRT"):
        member_named(name)
