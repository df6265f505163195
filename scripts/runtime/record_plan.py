"""Tests that may hold one measurement twice, and those that hang on others: by the sheets alone."""

from runtime.plan import owner

# Tests that are asked what they repeat, and those in which it may count instead: a test that may be
# fitted repeats nothing of one that may not, so that another drive leaves what is fitted alone.
COUNTED_IN = {"fit": ["fit"], "validation": ["fit", "validation", "split"]}
ASKED = {"fit": ["fit"], "validation": ["validation", "split"]}


class RecordPlan:
    """The records of a campaign's cells beside each other.

    Parameters
    ----------
    plan : Plan
    evidence_kinds : kinds of test whose loads tell resistances, models and their errors
    series_kinds : kinds of test that have a series

    Attributes
    ----------
    repeatable : cells with several tests in which one measurement may stand twice, by part of
        `COUNTED_IN`
    repeats : paths of what those tests repeat of each other
    """

    def __init__(self, plan, *, evidence_kinds, series_kinds):
        self.plan, self.evidence_kinds, self.series_kinds = plan, evidence_kinds, series_kinds
        self.repeatable = {
            part: plan.cells_where(lambda cell, of=part: len(self._evidence(cell, of)) > 1)
            for part in COUNTED_IN
        }
        self.repeats = [
            f"results/stages/repeats/{cell}/{part}.parquet"
            for part, cells in self.repeatable.items()
            for cell in cells
        ]

    def _evidence(self, cell, part):
        roles = COUNTED_IN[part]
        return self.plan.artefacts("clean", cell, *self.evidence_kinds, roles=roles)

    def several(self, stage, cell):
        """Artefacts of one stage of all series of a cell, where it has several of them."""
        paths = self.plan.artefacts(stage, cell, *self.series_kinds)
        return paths if len(paths) > 1 else []

    # Functions of a job.

    def evidence_of(self, wildcards):
        """Clean series of the tests among which those of a part are asked what they repeat."""
        return self._evidence(owner(wildcards), wildcards.part)

    def asked_roles(self, wildcards):
        """Roles of the tests of a part, which are asked."""
        return ASKED[wildcards.part]

    def repeats_of(self, wildcards):
        """What a test of a cell repeats of others, where there are any."""
        cell = wildcards.cell
        role = self.plan.tests[cell, wildcards.test]["role"]
        part = "fit" if role == "fit" else "validation"
        found = f"results/stages/repeats/{cell}/{part}.parquet"
        return [found] if cell in self.repeatable[part] else []

    def course_of(self, wildcards):
        """The order in time of the tests of a cell that ages: an aged cell's rest tells no state.

        A fresh cell's does, and none of its tests then hangs on another. A group has none.
        """
        cell = wildcards.cell
        rows = self.plan.rows(cell, *self.series_kinds) if cell in self.plan.cells else []
        ages = any(row["cycle"] or row["kind"] == "ageing" for row in rows)
        several = ages and self.several("clean", cell)
        return [f"results/stages/course/{cell}.parquet"] if several else []
