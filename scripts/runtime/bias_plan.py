"""Cells of which type are compared to judge models that were lent: by the sheets alone."""

from runtime.plan import of_rows

MOST_JUDGED = 60  # cells of a type


class BiasPlan:
    """The types whose cells judge ways to a model.

    Parameters
    ----------
    plan : Plan
    fits : ModelPlan

    Attributes
    ----------
    judged : cells of one type with models of their own, of which some have tests that no fit has
        seen; by the first of them
    """

    def __init__(self, plan, fits):
        self.plan, self.fits = plan, fits
        of_types = (self._of_type(cells) for cells in fits.of_type.values())
        self.judged = {
            cells[0]: cells
            for cells in of_types
            if len(cells) > 1 and any(map(fits.scored.get, cells))
        }

    def _of_type(self, cells):
        """Cells of a type that are compared: spread over the sheet, marked ones first."""
        shows = [cell for cell in cells if cell in self.fits.excited and self._shows(cell)]
        marked = [cell for cell in shows if self._is_marked(cell)]
        rest = [cell for cell in shows if cell not in marked and self.fits.scored[cell]]
        most = max(MOST_JUDGED - len(marked), 1)
        return [*marked, *rest[:: -(-len(rest) // most) or 1]]

    def _shows(self, cell):
        """Tests that tell one cell of a type from another."""
        return self.plan.rows(cell, "capacity", "ica", roles=["fit"])

    def _is_marked(self, cell):
        return self.plan.cells[cell]["reference"] == "yes"

    def judged_with(self, cells):
        """First cells of the types that any of these cells is compared in."""
        return [first for first, judged in self.judged.items() if not set(judged).isdisjoint(cells)]

    # Functions of a job.

    def inputs(self, wildcards):
        """What the cells of a type show, their models, and the tests that those are scored on."""
        cells = self.judged[wildcards.cell]
        shown = {
            "peaks": ("ica", "ica"),
            "curves": ("ica_curve", "ica"),
            "onset": ("onset", "capacity"),
            "capacity": ("capacity", "capacity"),
        }
        return {
            f"peer_{name}": [path for cell in cells for path in self.plan.fitted(stage, cell, kind)]
            for name, (stage, kind) in shown.items()
        } | {
            "peer_basis": [f"results/stages/basis/{cell}.json" for cell in cells],
            "peer_models": [f"results/stages/identify/{cell}.json" for cell in cells],
            "own": [f"results/models/{cell}.json" for cell in cells],
            "series": [p for c in cells for p in of_rows("clean", c, self.fits.scored[c])],
        }

    def references(self, wildcards):
        """Marked cells among those of a type that are compared."""
        return list(filter(self._is_marked, self.judged[wildcards.cell]))

    def facts(self, wildcards):
        """Facts of those cells, by name."""
        return {cell: self.plan.facts_of(cell) for cell in self.judged[wildcards.cell]}
