"""What a campaign's sheets say of each cell, group and test, and which artefacts follow from that.

Rules ask here for paths and facts. A function of a job takes Snakemake's wildcards, as inputs and
parameters of rules may; the others take the name of a cell or group.
"""

from cellwright.health.electrodes.names import half_cell_files
from cellwright.packs import wiring
from cellwright.records.conditions import SAME_CHECKUP_CYCLES, in_first_checkup

ALL_ROLES = ("fit", "validation", "split")
# Of the sheets' rows what analyses need: a note edited later re-runs none of them.
FACTS_OF_TEST = ("kind", "ambient_temperature_celsius", "cycle", "soc", "role", "started")
FACTS_OF_FILES = ("file", "sha256", "instrument", "current_sign", "columns")
FACTS_OF_CELL = (
    *("cell", "rated_capacity_ampere_hour", "lower_cutoff_volt", "upper_cutoff_volt"),
    "state_of_health",
)
# What a reader of a table needs to compare rows; everything else is one look at the sheet away.
FACTS_IN_TABLES = ("cycle", "ambient_temperature_celsius", "soc")
ELECTRODES = ("negative", "positive")
CAPACITY_KINDS = ("capacity", "ocv")
# Tests that tell what SoC refers to: charges for dQ/dV too, where they are slow.
SIZE_KINDS = (*CAPACITY_KINDS, "ica")
PULSE_KINDS = ("hppc", "pulse_resistance")
# Tests that a search for a missing effect may be fitted to or proven on.
EFFECT_KINDS = ("capacity", *PULSE_KINDS, "drive")
OWNERS = ("cell", "group", "fleet", "owner")


def owner(wildcards) -> str:
    """The cell, group or fleet that a job is about."""
    # Snakemake's wildcards are a list of values, whose names are asked for by `get`.
    return next(filter(None, map(wildcards.get, OWNERS)))


def own(function):
    """Function of a job: what `function` gives for its cell or group, such as `groups.get`."""
    return lambda wildcards: function(owner(wildcards))


def paths_of(names, template):
    """Function of a job: a path for each name that `names` gives for its cell or group."""
    return lambda wildcards: [template.format(name) for name in names(owner(wildcards))]


def gathered(names, function):
    """Function of a job: all that `function` lists for each name that `names` gives for it."""
    return lambda wildcards: [one for name in names(owner(wildcards)) for one in function(name)]


def where(cells, template):
    """Function of a job: the path of its cell where that is among `cells`, else none."""
    return lambda wildcards: [template.format(name) for name in [owner(wildcards)] if name in cells]


def of_cell(cell, **stages):
    """The artefact of a cell in each of these stages: dict name → path."""
    return {name: f"results/stages/{stage}/{cell}.parquet" for name, stage in stages.items()}


def of_test(name, test, **stages):
    """The artefact of a test of a cell or group in each of these stages: dict name → path."""
    return {part: f"results/stages/{stage}/{name}/{test}.parquet" for part, stage in stages.items()}


def of_rows(stage, name, rows):
    """Paths of one stage's artefacts for these tests of a cell or group."""
    return [f"results/stages/{stage}/{name}/{row['test']}.parquet" for row in rows]


def near_in_cycles(row, cycles):
    """Whether a test belongs to the check-up at one of these cycles: it sees a cell of one age."""
    return any(abs((row["cycle"] or 0) - cycle) <= SAME_CHECKUP_CYCLES for cycle in cycles)


def of_first_checkup(rows):
    """Those of these tests of a cell that belong to the first check-up among them."""
    young = in_first_checkup([row["cycle"] for row in rows])
    return [row for row, is_young in zip(rows, young, strict=True) if is_young]


class Plan:
    """The sheets of a campaign, looked up by cell, group and test.

    Parameters
    ----------
    campaign : sheets.Campaign

    Attributes
    ----------
    cells, tests : rows of the sheets by cell, and by (cell or group, test)
    tests_of : rows of the tests of each cell and group
    branches : rows of the members of each group, in order of position
    wired : those with the rows of the groups in it
    leaves : its cells, in the order in which cell voltages and temperatures of its records stand
    facts_in_tables : of each test, as `cell/test`, what tables say beside its results
    """

    def __init__(self, campaign):
        self.cells = {row["cell"]: row for row in campaign.cells}
        self.check_ups = campaign.check_ups
        self.tests = {(row["cell"], row["test"]): row for row in campaign.tests}
        # A group is tested like a cell: the sheet of tests names it in the same column.
        groups = [row["group"] for row in campaign.groups]
        self.tests_of = {name: [] for name in [*self.cells, *groups]}
        for row in campaign.tests:
            self.tests_of[row["cell"]].append(row)
        self.branches = {}
        # Rows of a sheet may be sorted in any way; logged channels are numbered by position.
        for row in sorted(campaign.groups, key=lambda row: row["position"]):
            self.branches.setdefault(row["group"], []).append(row)
        # Wirings are made once: thousands of jobs ask for them while the graph is built.
        self.wired = {name: wiring.rows_below(name, campaign.groups) for name in self.branches}
        self.leaves = {
            name: wiring.cells_of(wiring.wiring_of(name, rows)) for name, rows in self.wired.items()
        }
        self.facts_in_tables = {
            "/".join(key): {name: row[name] for name in FACTS_IN_TABLES}
            for key, row in self.tests.items()
        }

    def rows(self, name, *kinds, roles=ALL_ROLES):
        """Rows of the sheet: tests of a cell or group of these kinds and roles."""
        return [row for row in self.tests_of[name] if row["kind"] in kinds and row["role"] in roles]

    def artefacts(self, stage, name, *kinds, roles=ALL_ROLES):
        """Paths of one stage's artefacts for the tests of a cell or group."""
        return of_rows(stage, name, self.rows(name, *kinds, roles=roles))

    def fitted(self, stage, name, *kinds):
        """As `artefacts`, without the tests that must take no part in any fit or choice."""
        return self.artefacts(stage, name, *kinds, roles=["fit"])

    def everywhere(self, stage, *kinds, **roles):
        """Paths of one stage's artefacts for all cells and groups."""
        return [p for name in self.tests_of for p in self.artefacts(stage, name, *kinds, **roles)]

    def chamber_temperatures(self, cell, *kinds):
        """Stated temperatures of a cell's tests of these kinds that may be fitted [°C]."""
        rows = self.rows(cell, *kinds, roles=["fit"])
        return {row["ambient_temperature_celsius"] for row in rows} - {None}

    def rows_beside(self, kind, kinds, cell):
        """Tests of a cell of these kinds at the chamber temperatures of those of one kind."""
        there = {row["ambient_temperature_celsius"] for row in self.rows(cell, kind)} - {None}
        rows = self.rows(cell, *kinds)
        return [row for row in rows if row["ambient_temperature_celsius"] in there]

    def cycles(self, cell, *kinds):
        """Cycles at which a cell has tests of these kinds that may be fitted; blank: fresh."""
        # A set: check-ups of two kinds of test are compared by what cycles they have in common.
        return {row["cycle"] or 0 for row in self.rows(cell, *kinds, roles=["fit"])}

    def cells_where(self, condition, but=()):
        """Cells that satisfy a condition and are not among `but`, in the order of the sheet."""
        # A dict, for one cell is looked up in it by thousands of jobs.
        return dict.fromkeys(cell for cell in self.cells if cell not in but and condition(cell))

    def files_of_tests(self):
        """Raw files of all tests, as the sheet names them."""
        return [file for row in self.tests.values() for file in row["file"] or ()]

    def files_of_cells(self):
        """Files of the user's that are no raw files: simulations, models, half cells."""
        named = [row["simulated_file"] for row in self.tests.values()]
        named += [row["model_table"] for row in self.cells.values()]
        named += [file for name in self.cells for file in self.half_cell_files(name)]
        return list(dict.fromkeys(filter(None, named)))

    def half_cell_files(self, name):
        """Files among the half cells of a cell, each once."""
        names = (self.cells[name][f"{electrode}_half_cell"] for electrode in ELECTRODES)
        return sorted({file for value in names for file in half_cell_files(value)})

    def facts_of(self, name):
        """What analyses need of a cell; of a group, of its first cell."""
        # Limits of voltage are those of one cell, and all cells of a group are of one type.
        row = self.cells.get(name) or self.cells[self.leaves[name][0]]
        return {fact: row[fact] for fact in FACTS_OF_CELL}

    def facts_of_tests_of(self, names):
        """Of each test of these cells, as `cell/test`, what tables say beside its results."""
        keys = [f"{row['cell']}/{row['test']}" for name in names for row in self.tests_of[name]]
        return {key: self.facts_in_tables[key] for key in keys}

    # Functions of a job.

    def test_facts(self, wildcards):
        """What analyses need of a job's test."""
        row = self.tests[owner(wildcards), wildcards.test]
        return {fact: row[fact] for fact in FACTS_OF_TEST}

    def cell_facts(self, wildcards):
        """What analyses need of a job's cell; of a group, of its first cell."""
        return self.facts_of(owner(wildcards))

    def facts_of_own_tests(self, wildcards):
        """What tables say of each test of a job's cell."""
        return self.facts_of_tests_of([owner(wildcards)])

    def column(self, name):
        """What the sheet says of a job's cell in one column."""
        return lambda wildcards: self.cells[owner(wildcards)].get(name)

    def reading(self, wildcards):
        """How the sheet says that a test's files are to be read."""
        row = self.tests[owner(wildcards), wildcards.test]
        return {name: row[name] for name in FACTS_OF_FILES}

    def channels_of_group(self, wildcards):
        """How many members and cells a group has, whose channels files number; none of a cell."""
        if (name := owner(wildcards)) not in self.branches:
            return {}
        return {"members": len(self.branches[name]), "cells": len(self.leaves[name])}

    def curves_for_stated_soc(self, wildcards):
        """Slow tests of the cell whose open-circuit voltage a stated SoC is held against."""
        row = self.tests.get((owner(wildcards), wildcards.test), {})
        return self.fitted("ocv", owner(wildcards), "ocv") if row.get("soc") is not None else []

    def stated_check_ups(self, wildcards):
        """Rows of the sheet of check-ups of a job's cell."""
        return [row for row in self.check_ups if row["cell"] == owner(wildcards)]

    def columns_of_tests(self, *names):
        """These columns of the sheet for each test of a job's cell: a list of dict."""
        return lambda w: [{name: row[name] for name in names} for row in self.tests_of[owner(w)]]

    def column_of_tests(self, name):
        """What the sheet says of each test of a job's cell in one column: dict test → value."""
        return lambda w: {row["test"]: row[name] for row in self.tests_of[owner(w)]}

    def dated_facts_of_own_tests(self, wildcards):
        """What tables say of each test of a job's cell, and when it began, where that is stated."""
        dates = self.column_of_tests("started")(wildcards)
        facts = self.facts_of_own_tests(wildcards)
        return {key: one | {"started": dates[key.partition("/")[2]]} for key, one in facts.items()}

    def own_artefacts(self, stage, *kinds):
        """Artefacts of one stage of the tests of a job's cell or group."""
        return lambda wildcards: self.artefacts(stage, owner(wildcards), *kinds)

    def own_fitted(self, stage, *kinds):
        """The same without the tests that must take no part in any fit or choice."""
        return lambda wildcards: self.fitted(stage, owner(wildcards), *kinds)

    def own_rows(self, stage, rows):
        """Those of the tests that `rows` gives for a job's cell or group."""
        return lambda wildcards: of_rows(stage, owner(wildcards), rows(owner(wildcards)))

    def fitted_of(self, names, stage, *kinds):
        """Those of all cells that `names` gives for a job's cell or group."""
        return gathered(names, lambda name: self.fitted(stage, name, *kinds))

    def facts_of_cells(self, names):
        """Function of a job: what analyses need of each cell that `names` gives for it."""
        return lambda wildcards: [self.facts_of(name) for name in names(owner(wildcards))]

    def facts_of_tests_of_cells(self, names):
        """Function of a job: what tables say of the tests of those cells."""
        return lambda wildcards: self.facts_of_tests_of(names(owner(wildcards)))
