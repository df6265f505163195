"""The page of all artefacts and their columns, from the contract; run by hand, it prints them.

./run python scripts/documentation/artefacts_page.py
"""

from runtime import contract

INTRODUCTION = """\
# Artefacts and their columns

An artefact lies in `results/stages/<stage>/<cell or group>/<test>.parquet`; of `parameters` and of
stages that begin with `temperature` or `resistance_surface` there is one per cell,
`results/stages/<stage>/<cell>.parquet`. `tables/…` and
`summary` are CSV, and so are `models/lookup` and `models/over_temperature`,
`results/models/<cell>/….csv`. The parts of
`missing_effect/…` lie in `results/missing_effect/<cell>/`. Each is held against these columns and
ranges as it is written. A column in parentheses may be absent: not every instrument records it. In
`<k>` and `<model>` stand the number of a branch or pair and a member of the circuit family.
"""


def text() -> str:
    """The whole page, in Markdown."""
    return "\n".join([INTRODUCTION, *(section(*stage) for stage in contract.stages().items())])


def section(name: str, spec: dict) -> str:
    """A heading and a table of the columns of one stage of the contract, in Markdown."""
    rows = [["column", "unit", "range", "meaning"], ["---"] * 4]
    rows += [_column(column, about) for column, about in spec["columns"].items()]
    lines = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return f"## {name}\n\n{_sentence(spec['meaning'])}\n\n{lines}"


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _column(name: str, spec: dict) -> list[str]:
    shown = f"`{name}`" if spec.get("required", True) else f"(`{name}`)"
    return [shown, spec.get("unit", ""), _range(*spec.get("range", (None, None))), spec["meaning"]]


def _range(low, high) -> str:
    if low is None or high is None:
        return "" if low is high else f"≥ {low:g}" if high is None else f"≤ {high:g}"
    return f"{low:g} to {high:g}"


if __name__ == "__main__":
    print(text())
