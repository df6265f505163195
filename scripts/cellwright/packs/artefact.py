"""The pack model as a document: wiring, models of its cells, their start, and their errors.

The document (schema cellwright-pack/1) holds all that a simulation of the pack needs, and beside
it what tests have said of it: of each cell how well its model predicts tests that took no part in
its fit, of the pack how well currents and voltage of its group tests are predicted. What no test
has said is stated as such.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_check import each, needs, refuse_beyond, refuse_unusable
from cellwright.circuits.model_file import capacity_of
from cellwright.circuits.parameters import parameter_rows
from cellwright.packs.cells import member_in_pack
from cellwright.packs.thermal import Thermal
from cellwright.packs.wiring import Wiring, cells_of, charge_of
from cellwright.refusal import Refusal

SCHEMA = "cellwright-pack/1"
# Of a model file what a simulation needs; the rest tells how the model came about.
OF_MODEL = ("schema", "cell", "capacity_ampere_hour", "borrowed_from", "kind", "ocv", "fitted")
HEAT = (1e-9, 1e12)  # least and largest of both, J/K and K/W
OF_CELL = Thermal._fields[:2]  # heat capacity, and resistance to the ambient
CELL_SCORES = (
    *("test", "role", "kind", "ambient_temperature_celsius", "model", "rmse_volt"),
    *("rmse_volt_soc_5_95", "max_abs_volt", "mean_volt", "samples", "extrapolated"),
)


class CellInPack(NamedTuple):
    """What is known of one cell of a pack.

    model : dict of schema cellwright-model/2. initial_soc : at the start of the group's tests [1],
    None where not stated. thermal : Thermal, or None where nothing tells them.
    capacity_std_ampere_hour : standard deviation that repeats of its capacity show, or None.
    validation : list of dict, rows of stage `validation` with test, role, kind and
    ambient_temperature_celsius, of every member of its family.
    """

    model: dict
    initial_soc: float | None = None
    thermal: Thermal | None = None
    capacity_std_ampere_hour: float | None = None
    validation: tuple = ()


class PackModel(NamedTuple):
    """A pack model as a simulation takes it; what is of cells in the order of the leaves.

    wiring : Wiring. models : tuple of dict of schema cellwright-model/2, each with its chosen
    member only. initial_soc : tuple of float or None. thermal : tuple of Thermal or None.
    document : the whole document, with all errors.
    """

    wiring: Wiring
    models: tuple
    initial_soc: tuple
    thermal: tuple
    document: dict

    @property
    def cells(self):
        """Names of the cells in the order of the leaves."""
        return cells_of(self.wiring)


def pack_document(wiring, cells, group_tests=()):
    """The document of a pack model: dict of schema cellwright-pack/1.

    Parameters
    ----------
    wiring : Wiring.
    cells : mapping, name → CellInPack, of every cell of the wiring.
    group_tests : list of dict, rows of stage `pack` of the group's tests with test, role, kind and
        ambient_temperature_celsius: errors of branch currents [A], of voltage [V] and others.

    Raises
    ------
    Refusal : a cell of the wiring without a model, or a model of another cell.
    """
    names = cells_of(wiring)
    lacking = [name for name in names if name not in cells]
    if lacking:
        raise Refusal(f"no model of {', '.join(lacking)}, wanted one of every cell of the pack")
    for name in names:
        found = cells[name].model.get("cell")
        if found != name:
            raise Refusal(f"the model given for {name} is of {found}")
    entries = [cell_entry(name, cells[name]) for name in names]
    models = [entry["model"] for entry in entries]
    tests = _group_tests(group_tests, models)
    capacities = np.array([entry["capacity_ampere_hour"] for entry in entries])
    return {
        "schema": SCHEMA,
        "group": wiring.name,
        "current_sign": "positive on charge",
        "wiring": tree_of(wiring),
        "capacity_ampere_hour": charge_of(wiring, capacities),
        "cells": entries,
        "tests": tests,
        "validated": any(_counts(test) for test in tests),
        "why_not_validated": _why_not_validated(tests),
    }


def cell_entry(name, cell):
    """Entry of a CellInPack in a document: its model with the chosen member alone, its errors."""
    member = member_in_pack(cell.model)
    model = {key: cell.model[key] for key in OF_MODEL if key in cell.model}
    model |= {"chosen": member["model"], "members": [member]}
    scores = [
        {key: row.get(key) for key in CELL_SCORES}
        for row in cell.validation
        if row["model"] == member["model"]
    ]
    unvalidated = None if scores else "it has no test that took no part in its fit"
    if cell.validation and not scores:
        unvalidated = f"its tests for validation were not simulated with {member['model']}"
    return {
        "cell": name,
        "capacity_ampere_hour": capacity_of(cell.model, member),
        "capacity_std_ampere_hour": cell.capacity_std_ampere_hour,
        "initial_soc": cell.initial_soc,
        "thermal": cell.thermal and {name: getattr(cell.thermal, name) for name in OF_CELL},
        "model": model,
        "instead_of": None if member["model"] == cell.model["chosen"] else cell.model["chosen"],
        "left_out_rmse_volt": member.get("left_out_rmse_volt"),
        "fit": [
            {key: condition.get(key) for key in ("ambient_temperature_celsius", "fit_rmse_volt")}
            for condition in member["conditions"]
        ],
        "validation": scores,
        "validated": bool(scores),
        "why_not_validated": unvalidated,
    }


def _group_tests(rows, models):
    """One entry a group test: its role, whether a model was fitted to it, errors by branch.

    `other_member` names cells that the test was simulated with in another member than the one that
    stands here: its errors are not those of this pack model.
    """
    about = ("test", "role", "ambient_temperature_celsius")
    # A group's test that its own models were fitted to says nothing of their prediction.
    fitted = {model["fitted"]["test"] for model in models if model.get("fitted")}
    chosen = {model["cell"]: model["chosen"] for model in models}
    tests = {}
    for row in rows:
        entry = {key: row.get(key) for key in about} | {"fitted": row["test"] in fitted}
        entry |= {"scored": False, "branches": [], "other_member": []}
        entry = tests.setdefault(row["test"], entry)
        entry["scored"] |= bool(scores_in(row))
        known = (*about, "group", "cycle", "soc")
        entry["branches"].append({key: value for key, value in row.items() if key not in known})
        if row.get("model") is not None and row["model"] != chosen.get(row.get("cell")):
            entry["other_member"].append(row.get("cell"))
    return list(tests.values())


def scores_in(row):
    """Root mean square errors in a row of a group test: name → value, of what was logged."""
    found = {key: value for key, value in row.items() if "rmse" in key and value is not None}
    return {key: value for key, value in found.items() if value == value}  # NaN is not logged


def _counts(test):
    """Whether the errors of a group test are those of a prediction by this very pack model."""
    return test["scored"] and not test["fitted"] and not test["other_member"]


def _why_not_validated(tests):
    if any(_counts(test) for test in tests):
        return None
    if not tests:
        return "the group has no test"
    names = ", ".join(test["test"] for test in tests)
    if not any(test["scored"] for test in tests):
        return f"{names} logged no branch current or voltage to compare with"
    if all(test["fitted"] for test in tests):
        return f"its models were fitted to part of {names}; the errors are of the remaining part"
    others = ", ".join(dict.fromkeys(cell for test in tests for cell in test["other_member"]))
    return f"{names} was simulated with another model of {others} than the one given here"


def tree_of(wiring):
    """A wiring as nested dicts: group, connection, terminals, sense, members.

    Each member has contact_ohm and link_ohm [Ω], and either `cell` or what a group has.
    """
    members = zip(wiring.members, wiring.contact_ohm, wiring.link_ohm, strict=True)
    return {
        "group": wiring.name,
        "connection": wiring.connection,
        "terminals": wiring.terminals,
        "sense": wiring.sense,
        "members": [
            ({"cell": member} if isinstance(member, str) else tree_of(member))
            | {"contact_ohm": contact, "link_ohm": link}
            for member, contact, link in members
        ],
    }


def wiring_of_tree(tree):
    """The Wiring of nested dicts, as `tree_of` writes them.

    Raises
    ------
    Refusal : a connection or ends of another name, no members, a resistance below zero or none.
    """
    needs("wiring", tree, "group", "members")
    allowed = {"connection": ("parallel", "series"), "terminals": ("same_end", "opposite_ends")}
    for key, names in allowed.items():
        if tree.get(key) not in names:
            found = f"{key} {tree.get(key)!r} of group {tree.get('group')!r}"
            raise Refusal(f"{found}, wanted {' or '.join(names)}")
    members = tree["members"]
    if not members:
        raise Refusal(f"group {tree.get('group')!r} has no members")
    list(each(f"members of group {tree['group']!r}", members))  # refuses what is no list of such
    inner = tuple(m["cell"] if "cell" in m else wiring_of_tree(m) for m in members)
    ohms = [tuple(_ohm(m, key) for m in members) for key in ("contact_ohm", "link_ohm")]
    ends = tree["terminals"], tree.get("sense")
    return Wiring(tree["group"], tree["connection"], inner, *ohms, *ends)


def _ohm(member, key):
    value = member.get(key)
    # So written it refuses what is no number as well.
    if not isinstance(value, int | float) or not 0 <= value < float("inf"):
        name = member.get("cell") or member.get("group")
        raise Refusal(f"{key} of {name} is {value!r}, wanted a resistance of 0 or more")
    return float(value)


def read_pack(document):
    """The pack model of a document, checked as far as a simulation relies on it.

    Parameters
    ----------
    document : dict of schema cellwright-pack/1.

    Raises
    ------
    Refusal : another schema, what `wiring_of_tree` refuses, cells that are not those of the
        wiring, or what `model_check.refuse_unusable` refuses of their models.
    """
    found = document.get("schema") if isinstance(document, dict) else type(document).__name__
    if found != SCHEMA:
        raise Refusal(f"schema is {found!r}, wanted {SCHEMA}")
    needs("pack", document, "wiring", "cells")
    wiring = wiring_of_tree(document["wiring"])
    for place, entry in each("pack: cells", document["cells"]):
        needs(place, entry, "cell", "model", "initial_soc")
        if entry["initial_soc"] is not None:
            refuse_beyond(f"{place}.initial_soc", entry["initial_soc"], 0.0, 1.0)
        if entry.get("thermal"):
            needs(f"{place}.thermal", entry["thermal"], *OF_CELL)
            for name in OF_CELL:
                refuse_beyond(f"{place}.thermal.{name}", entry["thermal"][name], *HEAT)
    entries = {entry["cell"]: entry for entry in document["cells"]}
    names = cells_of(wiring)
    if sorted(names) != sorted(entries) or len(names) != len(document["cells"]):
        given = ", ".join(entry["cell"] for entry in document["cells"])
        raise Refusal(f"cells are {given}, wanted those of the wiring, each once: {names}")
    for name in names:
        refuse_unusable(entries[name]["model"], name)
    thermal = (entries[name].get("thermal") for name in names)
    return PackModel(
        wiring=wiring,
        models=tuple(entries[name]["model"] for name in names),
        initial_soc=tuple(entries[name]["initial_soc"] for name in names),
        thermal=tuple(values and Thermal(**values) for values in thermal),
        document=document,
    )


def pack_lookup(document):
    """The tables of all cells of a pack in long form, one row a value.

    Linear in SoC between the rows of one quantity and held flat outside them, as the model is read;
    `ocv` is read at the SoC that `ocv_missing` and `ocv_stretch` of the same temperature make of
    the counted one: 1 − missing − (1 − soc)·(1 + stretch); `ocv_shift` adds to it.

    Parameters
    ----------
    document : dict of schema cellwright-pack/1.

    Returns
    -------
    rows : list of dict: cell, model, ambient_temperature_celsius, soc (None: of no SoC), parameter,
        value, std (None: not known), unit.
    """
    rows, columns = [], ("ambient_temperature_celsius", "soc", "parameter", "value", "std", "unit")
    for entry in document["cells"]:
        model = entry["model"]
        about = {"cell": entry["cell"], "model": model["chosen"]}
        size = entry["capacity_ampere_hour"], entry["capacity_std_ampere_hour"]
        values = [(None, None, "capacity", *size, "Ah")]
        for table in model["ocv"]:
            celsius = table["ambient_temperature_celsius"]
            pairs = zip(table["soc"], table["ocv_volt"], strict=True)
            values += [(celsius, soc, "ocv", volt, None, "V") for soc, volt in pairs]
        rows += [about | dict(zip(columns, value, strict=True)) for value in values]
        for row in map(dict, parameter_rows(model)):
            del row["at_bound"]
            rows.append({"cell": entry["cell"]} | row)
    return rows
