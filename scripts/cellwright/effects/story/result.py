"""Result of a search for missing effects, of a cell or of a parallel group."""

from typing import NamedTuple

from cellwright.result import Result

NONE = {}  # of a group: what only the search of a cell tells


class Finding(NamedTuple):
    """What a search found.

    verdict : dict of the contract. ranking, residual_map, evidence, series : dicts of
    columns; of a group only ranking and series hold any. model : dict, of a cell see
    `finding.model_of`, of a group `groups.model.document`. notes : tuple of str.
    """

    verdict: dict
    ranking: dict = NONE
    residual_map: dict = NONE
    evidence: dict = NONE
    series: dict = NONE
    model: dict = NONE
    notes: tuple = ()

    def result(self):
        """What the public step gives: the tables, and verdict and model as content."""
        names = ("ranking", "residual_map", "evidence", "series")
        tables = {name: getattr(self, name) for name in names}
        return Result(tables, {"verdict": self.verdict, "model": self.model}, self.notes)
