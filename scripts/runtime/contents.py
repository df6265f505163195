"""`results/README.md`: what lies where in the results of a campaign."""

from runtime import contract

TEXT = """\
# Results of {title}

| here | what it is |
|---|---|
| `report.html` | the report, one file: the campaign, each cell and pack, methods, settings |
| `summary.csv` | one row per cell: capacity, health, resistance, model, verdict, doubts |
| `tables/` | all numbers of the report as CSV, units in the names of columns (listed below) |
| `models/` | `<cell>.json`, a cell's model; `<cell>/`, the same for PyBaMM and as tables |
| `pack_models/` | models of packs, where the campaign has any |
| `missing_effect/` | what the model of a cell or pack lacks: `<cell>/verdict.json` |
| `figures/` | the figures of the report as SVG |
| `stages/` | what lies between the raw files and all this: `stages/<stage>/<cell>/<test>.parquet` |
| `ro-crate-metadata.json` | which job made which file of what, as a Workflow Run RO-Crate |
| `stages/manifest.tsv` | SHA-256 of every file; `snakemake verify` compares them |

What was left out, and why, stands in `tables/excluded.csv`; what broke a law of physics in
`tables/checks.csv`. A number with something against it says so in the column `doubt` of its row.
A file holds, or has beside it in `<file>.provenance.json`, what it was made from: rule, settings,
SHA-256 of its inputs, of the code and of the locked environment.

| table | its rows |
|---|---|
{tables}
| stage | what its files hold |
|---|---|
{stages}"""


def text(title: str, tables: list[str], stages: list[str]) -> str:
    """The page, in Markdown.

    Parameters
    ----------
    title : of the campaign
    tables, stages : those that it has
    """
    return TEXT.format(
        title=title,
        tables=_lines({name: f"tables/{name}" for name in sorted(tables)}),
        stages=_lines({name: name for name in sorted(stages)}),
    )


def _lines(entries: dict[str, str]) -> str:
    """A line for each name, with what the contract says of its entry; JSON documents have none."""
    meanings = {name: spec["meaning"] for name, spec in contract.stages().items()}
    said = {name: meanings.get(entry, "a JSON document") for name, entry in entries.items()}
    return "".join(f"| `{name}` | {meaning} |\n" for name, meaning in said.items())
