"""Which cells have a model, from what, and what it is held against: by the sheets alone."""

from cellwright.identification.lacking import FIT_ROLES
from runtime.plan import CAPACITY_KINDS, near_in_cycles, of_first_checkup, of_rows

# Kinds of test of which a logged temperature may tell how a cell warms.
WARMING_KINDS = ("capacity", "hppc", "ica")


class ModelPlan:
    """The models of a campaign's cells.

    A cell's model comes from its own pulses or drives, else from the table that the sheet gives of
    it, else from its type's reference, else from its own long loads, else from its group.

    Parameters
    ----------
    plan : Plan
    scored_kinds : kinds of test that a model may be held against

    Attributes
    ----------
    of_type, marked_of_type : cells of each stated type, and those of them marked as reference
    excited, given, biased, loaded, grouped : cells by what their model comes from, in this order;
        `grouped` has the group of each
    identified : those with a fit of their own; modelled, unmodelled : all with a model, and without
    parallel : rows of the members of each plain group of cells in parallel
    checkups : cycles of the later check-ups of each cell that have a model of their own
    scored : tests of each modelled cell that took no part in its fit
    shifted : cells whose open-circuit voltage may have moved since their first check-up
    warmed : cells with tests in which they warm by loads both ways, or by pulses
    """

    def __init__(self, plan, *, scored_kinds):
        self.plan = plan
        self.of_type, self.marked_of_type = {}, {}
        for cell in plan.cells:
            # What is not stated is of no type.
            if None not in self.type_of(cell):
                self.of_type.setdefault(self.type_of(cell), []).append(cell)
                if plan.cells[cell]["reference"] == "yes":
                    self.marked_of_type.setdefault(self.type_of(cell), []).append(cell)
        self.excited = plan.cells_where(self.fit_tests)
        self.given = plan.cells_where(self._has_table, self.excited)
        self.biased = plan.cells_where(self._is_calibrated, self.excited | self.given)
        own = self.excited | self.given | self.biased
        self.loaded = plan.cells_where(self._has_several_loads, own)
        self.identified = self.excited | self.loaded
        # In series nothing tells one cell's charge by itself.
        self.parallel = {
            group: rows
            for group, rows in plan.branches.items()
            if rows[0]["connection"] == "parallel"
            if [row["cell"] for row in rows] == list(plan.leaves[group])
        }
        self.grouped = {
            row["cell"]: group
            for group, rows in self.parallel.items()
            for row in rows
            if row["cell"] not in own | self.loaded and plan.rows(group, "group", roles=["fit"])
        }
        self.modelled = self.identified | self.given | self.biased | self.grouped
        self.unmodelled = dict.fromkeys(cell for cell in plan.cells if cell not in self.modelled)
        self.checkups = {
            cell: cycles for cell in self.identified if (cycles := self._later_checkups(cell))
        }
        proof = {"roles": ["validation", "split"]}
        self.scored = {cell: plan.rows(cell, *scored_kinds, **proof) for cell in self.modelled}
        self.shifted = plan.cells_where(self.aged_capacity_tests)
        self.warmed = plan.cells_where(
            lambda cell: (
                cell in self.identified | self.biased
                and plan.rows(cell, *WARMING_KINDS, roles=["fit"])
            )
        )

    def type_of(self, cell):
        """Cells of one type share chemistry and rating."""
        row = self.plan.cells[cell]
        return row["chemistry"], row["rated_capacity_ampere_hour"]

    def types_of(self, cells):
        """Those of these cells of each type, by its name, where they are several."""
        named = {
            f"{chemistry or 'chemistry not stated'}, {rating:g} Ah" if rating else chemistry: names
            for (chemistry, rating), names in self.of_type.items()
        }
        parts = {name: [cell for cell in names if cell in cells] for name, names in named.items()}
        return {name: part for name, part in parts.items() if len(part) > 1}

    def references(self, cell):
        """Other cells of the type that are marked as reference."""
        return [c for c in self.marked_of_type.get(self.type_of(cell), []) if c != cell]

    def excited_references(self, cell):
        """Those of them that have a model of their own pulses or drives."""
        return [reference for reference in self.references(cell) if reference in self.excited]

    def peers(self, cell):
        """Other cells of the type, from which a cell may borrow: the marked ones, else all."""
        others = (c for c in self.of_type.get(self.type_of(cell), []) if c != cell)
        return self.references(cell) or list(others)

    def calibrating(self, cell):
        """Other cells of the type that have a model of their own pulses or drives."""
        alike = self.of_type.get(self.type_of(cell), [])
        return [c for c in alike if c != cell and c in self.excited]

    def curve_lenders(self, cell):
        """Peers whose OCV a cell may borrow, should it have none, or none that can be used.

        Where no peer is marked as reference, a cell with a slow test of its own asks nobody: a
        campaign of a thousand such cells would else make a million dependencies.
        """
        if not self.references(cell) and self._slow(cell):
            return []
        return [peer for peer in self.peers(cell) if self._slow(peer)]

    def is_lent_a_curve(self, cell):
        """Whether any of them has one."""
        return bool(self.curve_lenders(cell))

    def _slow(self, cell):
        """Slow tests of a cell that may be fitted."""
        return self.plan.rows(cell, "ocv", roles=["fit"])

    def _has_table(self, cell):
        return self.plan.cells[cell].get("model_table")

    def _is_calibrated(self, cell):
        return self.plan.rows(cell, "ica", "drive", "capacity") and self.calibrating(cell)

    def _has_several_loads(self, cell):
        """Whether long loads may tell a model: beside a slow test or a lent curve, or two."""
        slow = self._slow(cell) or self.curve_lenders(cell)
        fits = self.long_loads(cell)
        return bool(fits and (slow or len(self.long_loads(cell, "ica")) > 1))

    def fit_tests(self, cell):
        """HPPC tests and drives that may be fitted (`fit`, or the odd blocks of `split`)."""
        kinds = ("hppc", "drive")
        return [row for kind in kinds for row in self.plan.rows(cell, kind, roles=FIT_ROLES[kind])]

    def long_loads(self, cell, *kinds):
        """Capacity tests of a cell's first check-up (and tests of `kinds`) that may be fitted."""
        return of_first_checkup(self.plan.rows(cell, "capacity", *kinds, roles=["fit"]))

    def fit_series(self, cell):
        """What a model is fitted to; capacity tests join the pulses, whose loads are short."""
        rows = self.fit_tests(cell) or self.long_loads(cell)
        if any(row["kind"] == "hppc" for row in rows):
            rows = rows + self.plan.rows(cell, "capacity", roles=["fit"])
        return of_rows("clean", cell, rows)

    def resting(self, name):
        """Pulse tests whose rests give an OCV curve: of check-ups without a slow test."""
        slow = [row["cycle"] or 0 for row in self.plan.rows(name, "ocv")]
        sized = self.plan.rows(name, "capacity", roles=["fit"])
        aged = [row["cycle"] or 0 for row in sized] if slow else [0]
        return [
            row
            for row in self.plan.rows(name, "hppc", roles=["fit"])
            if not near_in_cycles(row, slow) and (not slow or near_in_cycles(row, aged))
        ]

    def other_curves(self, cell):
        """OCV curves beside the slow ones: of rests; of long loads where nothing else tells one."""
        told = cell not in self.identified or self._slow(cell) or self.resting(cell)
        loads = [] if told or self.curve_lenders(cell) else self.long_loads(cell, "ica")
        rests = of_rows("ocv_rests", cell, self.resting(cell))
        return [*rests, *of_rows("ocv_load", cell, loads)]

    def aged_capacity_tests(self, cell):
        """Capacity tests of a cell, where they lie at several ages."""
        rows = self.plan.rows(cell, "capacity", roles=["fit"])
        young = [min((row["cycle"] or 0 for row in rows), default=0)]
        return [] if all(near_in_cycles(row, young) for row in rows) else rows

    def warming_tests(self, cell):
        """Tests that tell how a cell warms, and those that score it."""
        told = self.plan.rows(cell, *WARMING_KINDS, roles=["fit"])
        return [*told, *self.plan.rows(cell, "drive", roles=["validation"])]

    def _later_checkups(self, cell):
        """Cycles of the later check-ups that have an HPPC test and one that tells the capacity."""
        sized = self.plan.cycles(cell, *CAPACITY_KINDS)
        aged = [
            row["cycle"]
            for row in self.fit_tests(cell)
            if row["kind"] == "hppc" and near_in_cycles(row, sized)
        ]
        young = {"cycle": min(sized, default=0)}
        return sorted({f"{cycle:g}" for cycle in aged if not near_in_cycles(young, [cycle or 0])})

    def scored_at_its_age(self, cell):
        """Tests of the age of a cell's model that took no part in its fit."""
        later = [float(cycle) for cycle in self.checkups.get(cell, [])]
        return [row for row in self.scored[cell] if not near_in_cycles(row, later)]

    def scores_of(self, cell):
        """What those tests say of the model."""
        return of_rows("validation", cell, self.scored_at_its_age(cell))

    def modelled_leaves(self, group):
        """Cells of a group that have a model, in the order of its leaves."""
        return [cell for cell in self.plan.leaves[group] if cell in self.modelled]

    def warmed_leaves(self, group):
        """Cells of a group that have tests which may tell their thermal constants."""
        return [cell for cell in self.plan.leaves[group] if cell in self.warmed]

    def fit_celsius(self, cell):
        """Temperatures as stated at which a cell's model may be identified, ascending [°C]."""
        stated = {row["ambient_temperature_celsius"] for row in self.fit_tests(cell)}
        return sorted(stated - {None})

    def left_out_models(self, cell):
        """Models of a cell without each of its temperatures."""
        names = [f"{cell}/{celsius:g}" for celsius in self.fit_celsius(cell)]
        return [f"results/stages/left_out/{name}.json" for name in names]

    def predictable(self, cell, roles):
        """Series of drives and pulses at a temperature that a cell's model is identified at."""
        known = self.fit_celsius(cell)
        rows = self.plan.rows(cell, *FIT_ROLES, roles=roles)
        near = [row for row in rows if row["ambient_temperature_celsius"] in known]
        return of_rows("clean", cell, near)

    # Functions of a job.

    def source_of_model(self, wildcards):
        """The artefact of a cell's model: its own tests, a table, its IC peaks, or its group."""
        cell = wildcards.cell
        stages = {"identify": self.identified, "given_model": self.given, "bias": self.biased}
        own = [stage for stage, cells in stages.items() if cell in cells]
        stage, name = (own[0], cell) if own else ("branches", self.grouped[cell])
        return f"results/stages/{stage}/{name}.json"

    def series_of_checkup(self, wildcards):
        """Tests of one later check-up that its model is fitted to."""
        cell, at = wildcards.cell, [float(wildcards.checkup)]
        rows = [*self.fit_tests(cell), *self.plan.rows(cell, "capacity", roles=["fit"])]
        return of_rows("clean", cell, [row for row in rows if near_in_cycles(row, at)])

    def model_at_age(self, wildcards):
        """The model of a cell at the age of a test: that of its check-up where there is one."""
        cell, row = wildcards.cell, self.plan.tests[wildcards.cell, wildcards.test]
        later = self.checkups.get(cell, [])
        aged = [cycle for cycle in later if near_in_cycles(row, [float(cycle)])]
        of_checkup = [f"results/stages/models_of_checkups/{cell}/{cycle}.json" for cycle in aged]
        return of_checkup[:1] or f"results/models/{cell}.json"
