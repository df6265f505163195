"""Laws of the documents: made from the contract, complete, every link leads somewhere."""

import re

import pytest
from test_repository import HOST, MACHINE
from tree import ROOT

from real_cells import page, record
from runtime import contract, settings
from tools import architecture, contract_readme

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXTS = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}
ALL = "\n".join(TEXTS.values())
LINK = re.compile(r"\]\(([^)\s]+)\)")
SCHEMAS = ROOT / "workflow" / "schemas"


def rules() -> list[str]:
    files = [*(ROOT / "workflow" / "rules").rglob("*.smk"), ROOT / "workflow" / "Snakefile"]
    texts = [path.read_text(encoding="utf-8") for path in files]
    return sorted(
        rule for text in texts for rule in re.findall(r"^(?:rule|checkpoint) (\w+):", text, re.M)
    )


def anchors(text: str) -> set[str]:
    """What a heading is called in a link: lower case, hyphens for blanks, no punctuation."""
    heads = re.findall(r"^#+ (.+)$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_artefacts_page_is_what_the_contract_says():
    written = contract_readme.README.read_text(encoding="utf-8")
    assert written == contract_readme.text(), "run `python scripts/tools/contract_readme.py`"


def test_page_and_picture_of_the_rooms_are_what_the_code_says():
    made = {
        architecture.PAGE: architecture.page(),
        architecture.PICTURE: architecture.picture(),
    }
    for path, text in made.items():
        assert path.read_text(encoding="utf-8") == text, (
            "run `python scripts/tools/architecture.py`"
        )


def test_page_of_real_cells_is_what_the_record_says():
    written = record.PAGE.read_text(encoding="utf-8")
    assert written == page.committed(), "run `python scripts/tools/real_record.py --page`"


def test_record_of_real_cells_is_sound():
    assert record.faults_of(record.read(record.RECORDED)) == []


def test_every_published_number_has_a_value_and_a_source():
    rows = record.read(record.PUBLISHED).to_dict("records")
    assert len(rows) > 50
    assert not [row for row in rows if not row["source"] or not float(row["value"])]


def test_every_rule_is_documented():
    assert not [rule for rule in rules() if f"`{rule}`" not in ALL]


def test_every_kind_and_role_is_documented():
    columns = settings.load(SCHEMAS, "tests")["properties"]
    known = [*columns["kind"]["enum"], *columns["role"]["enum"]]
    assert not [name for name in known if f"| `{name}` |" not in TEXTS["docs/campaign.md"]]


def test_every_table_of_the_results_is_in_the_readme():
    tables = [f"{stage}.csv" for stage in contract.stages() if stage.startswith("tables/")]
    assert not [
        table for table in [*tables, "summary.csv"] if f"`{table}`" not in TEXTS["README.md"]
    ]


def test_every_flag_is_documented():
    from cellwright.series.cleaning import Flag

    assert not [
        flag.name for flag in Flag if f"`{flag.name.lower()}`" not in TEXTS["docs/cleaning.md"]
    ]


def test_every_page_is_linked_from_the_index():
    index = TEXTS["docs/README.md"]
    assert not [
        p
        for p in TEXTS
        if p.startswith("docs/") and p[5:] != "README.md" and f"]({p[5:]})" not in index
    ]


@pytest.mark.parametrize("page", PAGES, ids=TEXTS)
def test_every_link_leads_somewhere(page):
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        target = (page.parent / path) if path else page
        if re.match(r"https?:|mailto:", link):
            continue
        assert target.exists(), f"{page.name}: {link} leads nowhere"
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{page.name}: {link}"


@pytest.mark.parametrize("page", TEXTS)
def test_no_package_host_and_no_path_of_a_machine(page):
    assert not HOST.search(TEXTS[page])
    assert not MACHINE.search(TEXTS[page])
