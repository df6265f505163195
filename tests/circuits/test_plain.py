"""Which member serves tools that know RC pairs only."""

import pytest
import truth

from cellwright.circuits.model_file import is_plain, plain_member
from cellwright.refusal import Refusal

RC = {"kind": "RC", "r_ohm": [0.01] * 5, "tau_second": [10.0] * 5}
KINETIC = RC | {"kind": "kinetic", "scale_volt": [0.05] * 5}


def family(chosen, **members):
    """A model of members name=(error of what was left out, branches)."""
    model = truth.model()
    entry = model["members"][0]["conditions"][0]
    member_entries = [
        {"model": name, "left_out_rmse_volt": error, "conditions": [entry | {"branches": branches}]}
        for name, (error, branches) in members.items()
    ]
    return model | {"members": member_entries, "chosen": chosen}


def test_the_chosen_one_where_it_is_plain_whatever_its_error():
    model = family("a", a=(0.02, [RC]), b=(0.01, [RC, RC]))
    assert plain_member(model) == "a"
    assert [is_plain(member) for member in model["members"]] == [True, True]


def test_else_the_best_by_what_was_left_out_not_the_largest():
    model = family(
        "k", k=(0.002, [KINETIC]), a=(0.02, [RC]), b=(0.01, [RC] * 2), c=(0.03, [RC] * 9)
    )
    assert not is_plain(model["members"][0])
    assert plain_member(model) == "b"


def test_without_a_stated_error_the_one_of_most_pairs():
    assert plain_member(family("k", k=(None, [KINETIC]), a=(None, [RC]), b=(None, [RC] * 2))) == "b"
    assert plain_member(family("k", k=(None, [KINETIC]), a=(0.01, [RC]), b=(None, [RC] * 2))) == "a"


def test_one_temperature_with_more_than_pairs_is_enough_to_be_refused():
    model = family("a", a=(0.01, [RC]))
    entry = model["members"][0]["conditions"][0]
    model["members"][0]["conditions"] = [entry, entry | {"branches": [KINETIC]}]
    with pytest.raises(Refusal, match="no member of the model of A is made of RC pairs"):
        plain_member(model)
