"""The page of the tables that a campaign leaves and their columns, from the contract."""

from documentation.artefacts_page import section
from runtime import contract

INTRODUCTION = """\
# Tables and their columns

All of a campaign's results as plain CSV: one row per cell in `results/summary.csv`, all others in
`results/tables/`. Units stand in the names of the columns; a blank cell is not known. What speaks
against a number stands beside it, in words (`doubt`) and as stable codes for programs
(`doubt_codes`). This page is made from
[workflow/schemas/artefacts.yaml](../workflow/schemas/artefacts.yaml).
"""
FOLDER = "tables/"


def text() -> str:
    """The whole page, in Markdown."""
    stages = contract.stages()
    tables = {"summary.csv": stages["summary"]} | {
        f"{name.removeprefix(FOLDER)}.csv": spec
        for name, spec in stages.items()
        if name.startswith(FOLDER)
    }
    return "\n".join([INTRODUCTION, *(section(*one) for one in tables.items())])
