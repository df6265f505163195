"""A model file that no cell can have is refused where it stands, by whoever simulates it."""

import copy
import json

import numpy as np
import pytest
import truth
from wirings import parallel

import cellwright as cw
import cellwright_fmu
from cellwright.circuits.model_check import refuse_unusable
from cellwright.packs.artefact import CellInPack, pack_document
from cellwright.refusal import Refusal

NAN = float("nan")
FIRST = ("members", 0, "conditions", 0)
BRANCH = (*FIRST, "branches", 0)
BAD = [
    (
        ("capacity_ampere_hour",),
        NAN,
        "capacity_ampere_hour is nan, wanted a number of 1e-06 or more",
    ),
    (("capacity_ampere_hour",), -5, "capacity_ampere_hour is -5, wanted"),
    (("capacity_ampere_hour",), 1e308, "capacity_ampere_hour is 1e+308, wanted"),
    (("capacity_ampere_hour",), 10**400, "capacity_ampere_hour is 1000"),
    (("capacity_ampere_hour",), None, "capacity_ampere_hour is None, wanted"),
    (("capacity_ampere_hour",), True, "capacity_ampere_hour is True, wanted"),
    ((*FIRST, "r0_ohm", 2), NAN, "members[0].conditions[0].r0_ohm[2] is nan, wanted a number of 0"),
    (
        (*FIRST, "r0_ohm", 2),
        -0.5,
        "members[0].conditions[0].r0_ohm[2] is -0.5, wanted a number of 0",
    ),
    ((*FIRST, "r0_ohm", 0), "0.03", "r0_ohm[0] is '0.03', wanted a number"),
    ((*FIRST, "r0_ohm"), [0.03], "r0_ohm is [0.03], wanted a list of 5 numbers, one an SoC"),
    ((*FIRST, "soc", 1), 0.9, "members[0].conditions[0].soc does not rise"),
    ((*FIRST, "soc"), 0.5, "members[0].conditions[0].soc is 0.5, wanted a list"),
    ((*BRANCH, "r_ohm", 1), -0.5, "branches[0].r_ohm[1] is -0.5, wanted a number of 0 or more"),
    ((*BRANCH, "tau_second", 1), 0.0, "branches[0].tau_second[1] is 0.0, wanted a number of"),
    ((*BRANCH, "kind"), "resistor", "branches[0].kind is 'resistor', wanted one of R,"),
    ((*BRANCH,), {}, "branches[0] lacks r_ohm, tau_second"),
    ((*FIRST, "branches"), None, "branches is None, wanted a list"),
    (("members",), [], "members is [], wanted a list of 1 entries or more"),
    (("members", 0), "2RC", "members[0] is '2RC', wanted keys with values"),
    (("members", 0), {}, "members[0] lacks model, conditions"),
    (("ocv", 0, "ocv_volt", 3), NAN, "ocv[0].ocv_volt[3] is nan, wanted a number"),
    (("ocv",), {}, "ocv is {}, wanted a list"),
]


def broken(path, value):
    model = copy.deepcopy(truth.stated())
    *above, last = path
    place = model
    for step in above:
        place = place[step]
    place[last] = value
    return model


@pytest.mark.parametrize(("path", "value", "said"), BAD)
def test_what_no_cell_has_is_refused_in_the_same_words_everywhere(path, value, said, tmp_path):
    model = broken(path, value)
    file = tmp_path / "a.json"
    file.write_text(json.dumps(model))
    current = {"test_time_second": np.arange(5.0), "current_ampere": np.zeros(5)}
    whole = pack_document(parallel("A"), {"A": CellInPack(truth.stated(), 0.6)})
    whole["cells"][0]["model"] = model
    uses = (
        lambda: refuse_unusable(model),
        lambda: cw.simulate(model, current, initial_soc=0.5),
        lambda: cw.simulate(file, current, initial_soc=0.5),
        lambda: cellwright_fmu.cell_fmu(model, initial_soc=0.5, points=11),
        lambda: cellwright_fmu.pack_fmu(whole, points=11),
    )
    for use in uses:
        with pytest.raises(Refusal) as refused:
            use()
        assert str(refused.value).startswith("model of A: ")
        assert said in str(refused.value)


def test_a_true_model_is_none_of_them():
    refuse_unusable(truth.stated())
    # A resistance of nothing is one, and a table of OCV may end beyond empty and full.
    refuse_unusable(broken((*FIRST, "r0_ohm", 2), 0.0))
    refuse_unusable(broken(("ocv", 0, "soc", 0), -0.01))
