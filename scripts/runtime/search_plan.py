"""Which cells and groups are searched for a missing effect, and with what: by the sheets alone."""

from runtime.plan import EFFECT_KINDS, of_first_checkup, of_rows, owner


class SearchPlan:
    """The searches of a campaign.

    Parameters
    ----------
    plan : Plan
    models : ModelPlan
    settings : section `missing_effect` of the config, of which `enabled` and `bases` count

    Attributes
    ----------
    asked : cells with any test that a search reads; one that cannot be searched says there why
    searched : those of them that can be
    groups_asked, groups_searched : the same of groups whose cells lie on one bar each, which is the
        group that the search simulates
    searched_own : cells of which is asked what the model in use lacks
    searched_external : cells of which is asked what a simulator of the user's lacks
    """

    def __init__(self, plan, models, settings):
        self.plan, self.models = plan, models
        enabled, bases = settings["enabled"], settings["bases"]
        self.asked = dict.fromkeys(
            cell for cell in plan.cells if enabled and plan.rows(cell, *EFFECT_KINDS)
        )
        self.searched = dict.fromkeys(filter(self._searchable, self.asked))
        self.groups_asked = [
            group
            for group, rows in models.parallel.items()
            if enabled and plan.rows(group, "group")
            if not any(row["link_resistance_ohm"] for row in rows)
        ]
        self.groups_searched = list(filter(self._group_searchable, self.groups_asked))
        own = self.searched if "own" in bases else ()
        self.searched_own = [cell for cell in own if cell in models.modelled]
        external = self.asked if "external" in bases else ()
        self.searched_external = list(filter(self.simulated_tests, external))

    def _searchable(self, cell):
        """Whether the sheet has tests to fit and one for proof, or so many that one can be spared.

        Of the first check-up alone: an aged cell lacks what a fresh one's model does not know.
        """
        rows = of_first_checkup(self.plan.rows(cell, *EFFECT_KINDS))
        fit = [row for row in rows if row["role"] in ("fit", "split")]
        proof = [row for row in rows if row["role"] in ("validation", "split")]
        return bool(fit and proof) or len(fit) >= 3

    def _group_searchable(self, group):
        """Whether its branches have models, and its tests leave one for proof."""
        lent = all(self.lender(row["cell"]) in self.searched for row in self.plan.branches[group])
        fit = self.plan.rows(group, "group", roles=["fit"])
        proof = self.plan.rows(group, "group", roles=["validation"])
        return lent and (bool(fit and proof) or len(fit) >= 3)

    def lender(self, cell):
        """The cell whose search tells what a branch's cell is like: itself, else of its type."""
        return next((c for c in [cell, *self.models.peers(cell)] if c in self.searched), cell)

    def simulated_tests(self, cell):
        """Tests of a cell that a search reads and for which the user has simulated a voltage."""
        return [row for row in self.plan.rows(cell, *EFFECT_KINDS) if row["simulated_file"]]

    def series(self, cell):
        """Series that a search of the plain base reads: the slow tests, too, which hold the OCV."""
        own = self.plan.artefacts("clean", cell, *EFFECT_KINDS)
        return [*own, *self.plan.fitted("clean", cell, "ocv")]

    def left_out_series(self, cell):
        """Whole tests that judge a member with effects, where those were searched for."""
        rows = self.models.scored_at_its_age(cell) if cell in self.searched else []
        return of_rows("clean", cell, [row for row in rows if row["role"] == "validation"])

    def choice_series(self, cell):
        """What decides which member a model uses: the tests that it was fitted to."""
        if cell not in self.models.identified:
            return []
        roles = ["fit", "split"] if cell in self.searched else []
        also = self.plan.artefacts("clean", cell, *EFFECT_KINDS, roles=roles)
        return list(dict.fromkeys([*self.models.fit_series(cell), *also]))

    # Functions of a job.

    def lenders(self, wildcards):
        """The cell that each branch of a group is held against: dict cell → its lender."""
        rows = self.plan.branches[owner(wildcards)]
        return {row["cell"]: self.lender(row["cell"]) for row in rows}

    def group_models(self, wildcards):
        """Models that the searches of a group's cells by themselves have left."""
        lenders = dict.fromkeys(self.lenders(wildcards).values())
        found = [cell for cell in lenders if cell in self.searched]
        return [f"results/missing_effect/{cell}/model.json" for cell in found]

    def simulated_files(self, wildcards):
        """The file that the user has simulated for each test of a job's cell."""
        rows = self.simulated_tests(owner(wildcards))
        return {row["test"]: row["simulated_file"] for row in rows}
