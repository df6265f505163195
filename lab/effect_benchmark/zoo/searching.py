"""One cell or group of a campaign searched as a run of the pipeline does, from its files on."""

import json
import time
from functools import cached_property
from pathlib import Path

import cellwright as cw
from cellwright.effects.groups.finding import KnownCell
from effect_benchmark import campaign
from runtime import settings, sheets
from runtime.artefact import plain
from virtual_lab.zoo import parts

NAN = float("nan")
CELL_FACTS = ("cell", "rated_capacity_ampere_hour", "lower_cutoff_volt", "upper_cutoff_volt")
KINDS = ("ocv", "capacity", "hppc", "pulse_resistance", "drive")  # as in rules/missing_effect.smk
LEAST_REFERENCES = 3


class Folder:
    """A campaign's sheets and settings; records and bases of its cells, each read once.

    Parameters
    ----------
    path : of the campaign. overrides : settings that go before those of its config.yaml.

    Raises
    ------
    CampaignError : faults in its sheets, or no sheets.
    """

    def __init__(self, path, overrides=None):
        self.sheets = campaign.read(path)
        self.config = sheets.read(Path(path), campaign.SCHEMAS, overrides or {}).config
        self._records, self._bases = {}, {}
        ocv = self.config["ocv"]
        self.steps = campaign.Steps(
            self.config["clean"], self.config["segment"], ocv["least_hour"], ocv["rest_second"]
        )

    @cached_property
    def plans(self) -> dict:
        """Schema of each section of the config, which tells keys that reach no analysis."""
        return settings.load(campaign.SCHEMAS, "config")["properties"]

    def of_analysis(self, section):
        """Settings of a section that reach an analysis."""
        keys = self.plans[section]["properties"]
        return {
            name: self.config[section][name] for name, spec in keys.items() if not spec.get("plans")
        }

    def records(self, cell):
        """The cleaned tests of a cell or group: (TestFacts, columns) each."""
        if cell not in self._records:
            self._records[cell] = campaign.readable_tests(self.sheets, cell, self.steps)
        return self._records[cell]

    def forget(self, cell):
        """Drop the records of a cell, which no other asks for."""
        self._records.pop(cell, None)
        self._bases.pop(cell, None)

    def facts(self, cell) -> dict:
        """What analyses are told of a cell."""
        return {name: self.sheets.cells[cell][name] for name in CELL_FACTS}

    def references(self, cell) -> list[str]:
        """Other cells of its chemistry and rating that are marked as reference."""
        return [c for c in self._alike(cell) if self.sheets.cells[c]["reference"] == "yes"]

    def basis(self, cell):
        """Capacity and OCV that the cell's SoC refers to, its own or lent, as in rule `basis`."""
        if cell not in self._bases:
            lenders = [self._lender(other) for other in self._curve_lenders(cell)]
            shown = campaign.shown(self.records(cell), self.facts(cell), self.steps)
            self._bases[cell] = cw.basis(
                self.facts(cell), shown.curves, shown.capacities, lenders, rests=shown.rests
            ).content
        return self._bases[cell]

    def _alike(self, cell):
        kind = self._type(cell)
        others = [c for c in self.sheets.cells if c != cell and self._type(c) == kind]
        return others if None not in kind else []

    def _type(self, cell):
        row = self.sheets.cells[cell]
        return row["chemistry"], row["rated_capacity_ampere_hour"]

    def _curve_lenders(self, cell):
        asked = self.references(cell) or not self._slow(cell)
        peers = self.references(cell) or self._alike(cell)
        return [c for c in peers if self._slow(c)] if asked else []

    def _slow(self, cell):
        return [
            row
            for row in self.sheets.tests.get(cell, [])
            if row["kind"] == "ocv" and row["role"] == "fit"
        ]

    def _lender(self, cell):
        shown = campaign.shown(self.records(cell), self.facts(cell), self.steps)
        marked = cell in self.references(cell) or self.sheets.cells[cell]["reference"] == "yes"
        return cw.lender(self.facts(cell), shown.curves, shown.capacities, marked=marked)


def answer(folder: Folder, name: str) -> dict:
    """Answer of the search on one cell or group: one row, its verdict as text in `document`.

    Parameters
    ----------
    folder : of the campaign. name : of the cell or group.

    Returns
    -------
    Row: cell, verdict, rounds, cpu_second [s] of the search alone, reason where there is none,
    document.
    """
    asked = _group_answer if name in folder.sheets.branches else _cell_answer
    try:
        verdict, spent = asked(folder, name)
    except cw.Refusal as refusal:
        return _row(name, None, NAN, str(refusal))
    return _row(name, verdict, spent, "")


def found_of(folder: Folder, cell: str):
    """(result of `cw.missing_effect`, CPU time [s]) of a cell.

    Raises
    ------
    Refusal : the cell cannot be searched.
    """
    mine, marked = _searched(folder, cell), folder.references(cell)
    others = [_searched(folder, c) for c in marked] if len(marked) >= LEAST_REFERENCES else []
    begun = time.process_time()
    found = cw.missing_effect(
        *mine,
        folder.of_analysis("missing_effect"),
        references=others,
        split_rest_second=folder.config["models"]["split_rest_second"],
    )
    return found, time.process_time() - begun


def _searched(folder, cell):
    """Facts, basis and tests of a cell, as the search takes them."""
    records = [record for record in folder.records(cell) if record[0].kind in KINDS]
    return folder.facts(cell), folder.basis(cell), records


def _cell_answer(folder, cell):
    found, spent = found_of(folder, cell)
    return found.verdict, spent


def _group_answer(folder, group):
    """The search in a group, its cells known by their own searches."""
    branches = folder.sheets.branches[group]
    known = [KnownCell(found_of(folder, row.cell)[0].model, row.cell) for row in branches]
    begun = time.process_time()
    found = cw.missing_group_effect(
        group, branches, known, folder.records(group), folder.config["missing_effect_group"]
    )
    return found.verdict, time.process_time() - begun


def _row(cell, verdict, spent, reason):
    named = (verdict or {}).get("effects", []) + (verdict or {}).get("partial", [])
    return {
        "cell": cell,
        "verdict": verdict["verdict"] if verdict else "",
        "rounds": len(named) + 1 if verdict else 0,
        "cpu_second": spent,
        "reason": reason,
        "document": json.dumps(plain(verdict), allow_nan=False) if verdict else "",
    }


def answers(folder: Folder, names) -> list[dict]:
    """Answers of several cells or groups, in the order given.

    Parameters
    ----------
    folder : of the campaign. names : of cells and groups.
    """
    rows = []
    for name in names:
        rows.append(answer(folder, name))
        if name in folder.sheets.cells and not folder.sheets.cells[name]["reference"]:
            folder.forget(name)
    return rows


def batch(path, number: int, of: int, overrides=None) -> list[dict]:
    """Answers of every `of`-th cell or group of a campaign, from the one with this number.

    Parameters
    ----------
    path : of the campaign. number, of : which part. overrides : settings, see `Folder`.
    """
    folder = Folder(path, overrides)
    return answers(folder, campaign.searched(folder.sheets)[number::of])


def part_batch(folder, number: int, of: int, overrides=None) -> list[dict]:
    """The same of all campaigns of a part of the zoo; rows say the campaign.

    Parameters
    ----------
    folder : of the part. number, of : which of how many batches. overrides : see `Folder`.

    Raises
    ------
    Refusal : the part was not made, or has fewer cells than batches.
    """
    made = Path(folder) / "made.json"
    if skipped := json.loads(made.read_text(encoding="utf-8"))["skipped"]:
        raise cw.Refusal(f"the part was not made: {skipped}")
    rows = [
        {"campaign": "" if path == Path(folder) else path.name} | row
        for path in parts.campaigns_of(folder)
        for row in batch(path, number, of, overrides)
    ]
    if not rows:
        raise cw.Refusal(f"no cell is left for batch {number} of {of}")
    return rows
