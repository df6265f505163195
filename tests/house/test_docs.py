"""Laws of the documents: what is made is complete, every page has a place, every link a target."""

import re
from posixpath import normpath

import pytest
from test_repository import HOST, MACHINE
from tree import ROOT, name

import cellwright
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.health.electrodes import half_cells
from documentation import (
    api_page,
    artefacts_page,
    demo_numbers,
    library_tables,
    pages,
    rooms,
    rules_page,
    settings_page,
)
from real_cells import page as real_cells_page
from real_cells import record
from runtime import contract, settings

SOURCES = [
    *(ROOT / file for file in ("README.md", "CONTRIBUTING.md", "config/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "decisions").glob("*.md")),
    *sorted((ROOT / "lab").glob("*.md")),
    ROOT / "benchmarks" / "README.md",
]
TEXTS = {name(path): path.read_text(encoding="utf-8") for path in SOURCES}
LINK = re.compile(r"\]\(([^)\s]+)\)")
SCHEMAS = ROOT / "workflow" / "schemas"
NAVIGATION = re.findall(
    r"^ *- .+: ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.M
)
EXAMPLES = {"scripts/largest.py"}  # of a workflow of one's own
MADE = {page: pages.text_of(page) for page in pages.MADE}
COMMITTED = pages.committed()


def anchors(text: str) -> set[str]:
    """What a heading is called in a link: lower case, hyphens for blanks, no punctuation."""
    heads = re.findall(r"^#+ (.+)$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_every_artefact_and_column_is_documented():
    text = artefacts_page.text()
    for stage, spec in contract.stages().items():
        assert f"## {stage}\n" in text
        assert not [column for column in spec["columns"] if f"`{column}`" not in text]


def test_every_column_and_key_is_documented():
    text = settings_page.text()
    for sheet in ("cells", "tests", "groups", "checkups"):
        columns = settings.load(SCHEMAS, sheet)["properties"]
        assert not [column for column in columns if f"| `{column}` |" not in text]
    for key, spec in settings.load(SCHEMAS, "config")["properties"].items():
        inner = settings.keys(spec) if spec.get("properties") else []
        assert f"`{key}`" in text or not inner
        assert not [one for one, _ in inner if f"| `{one}` |" not in text]


def test_every_rule_is_documented_with_its_message():
    files = [ROOT / "workflow" / "Snakefile", *(ROOT / "workflow" / "rules").glob("*.smk")]
    text = rules_page.text()
    for file in files:
        for rule in re.findall(r"^(?:rule|checkpoint) (\w+):", file.read_text("utf-8"), re.M):
            assert re.search(rf"^\| `{rule}` \| \S.+ \| .* \|$", text, re.M), f"{file.name}: {rule}"


def test_every_public_name_is_documented():
    text = api_page.text()
    for public in cellwright.__all__:
        assert re.search(rf"^### {public}\n\n```python\n.+\n```\n\n\S", text, re.M | re.S), public


def test_rooms_that_import_each_other_are_named():
    with pytest.raises(ValueError, match="in a circle: packs, series"):
        rooms.levels({"formats": set(), "series": {"packs"}, "packs": {"series", "formats"}})


def test_the_table_and_the_picture_of_the_rooms_have_all_of_them():
    names, table, picture = rooms.rooms(), rooms.table(), rooms.picture()
    assert len(names) > 10
    assert not [n for n in names if f"| `{n}` |" not in table or f">{n}</text>" not in picture]


def test_every_effect_parameter_and_tie_is_documented():
    """Also in numbers: a bound with its unit, a prior, a tried value, a size that is reported."""
    cell, branch, ties = (
        made() for made in (library_tables.of_cell, library_tables.of_branch, library_tables.ties)
    )
    for table, library in ((cell, LIBRARY), (branch, GROUP_LIBRARY)):
        rows = {row.split("`")[1]: row for row in table.splitlines()[2:]}
        assert rows.keys() == library.keys()
        for effect in library.values():
            names = {library_tables.NUMBERED.sub("_…_", one.name) for one in effect.parameters}
            assert not [name for name in names if f"`{name}`" not in rows[effect.id]]
            assert all(f"| `{effect.id}` |" in ties for _ in effect.ties)
    assert "`charge_coefficient` 0.2 to 0.8 (0.5 ± 0.1)" in cell
    assert "`small_loops_close` 0 or 1 |" in cell
    assert "`excess_ohm` −0.05 to 0.1 Ω | 0.0003 Ω |" in branch
    assert "| `current_gain` | `capacity_error` | always, exactly |" in ties


def test_every_half_cell_is_documented_with_its_range_and_paper():
    table = library_tables.of_half_cells()
    assert not [name for name in half_cells.LIBRARY if f"| `{name}` |" not in table]
    kim = "Kim et al., J. Electrochem. Soc. 158 (2011) A955"
    assert f"| `nca_kim` | 0.3 to 1 | {kim} |" in table


def test_numbers_and_claims_of_the_tutorial_are_those_of_the_record():
    rows = record.read(record.RECORDED)
    rows = rows[rows["campaign"] == "demo"].set_index(["cell", "quantity", "where"])["value"]
    capacity = float(rows["C4", "capacity", "25 °C, discharge, C/2"])
    lost = float(rows["C4", "lithium lost", "cycle 300"])
    row = f"| C4 | 300 | {capacity:.4g} Ah | – | {lost:.4g} % |"
    assert row in demo_numbers.of_cells().splitlines()
    after = float(rows["median of 8 cells", "error after the search", ""])
    assert f" to {after:.4g} mV." in demo_numbers.of_search()
    resistance = float(rows["C1", "pulse resistance", "25 °C, 50 % SoC, after 1 s"])
    assert f"after 1 s | {resistance:.4g} mΩ |" in demo_numbers.of_first()
    assert rows["all", "chosen member", "0 °C"] == "DRT+K+D: 1"  # only C1 has a drive there
    named = rows["all", "named effects", ""].split("; ")
    assert sum("charge_transfer_nonlinearity" in names for names in named) == 5  # not T1


def test_every_page_uses_parts_that_are_made():
    used = {part for text in TEXTS.values() for part, _ in pages.PART.findall(text)}
    assert used == set(pages.MADE_PARTS)


def test_record_of_real_cells_is_sound():
    assert record.faults_of(record.read(record.RECORDED)) == []


def test_page_of_real_cells_has_every_campaign_of_the_record():
    text = real_cells_page.of_record()
    for campaign in record.read(record.RECORDED)["campaign"].unique():
        assert f"\n## {campaign}\n" in text


def test_every_published_number_has_a_value_and_a_source():
    rows = record.read(record.PUBLISHED).to_dict("records")
    assert len(rows) > 50
    assert not [row for row in rows if not row["source"] or not float(row["value"])]


def test_every_kind_and_role_is_documented():
    columns = settings.load(SCHEMAS, "tests")["properties"]
    known = [*columns["kind"]["enum"], *columns["role"]["enum"]]
    assert not [name for name in known if f"| `{name}` |" not in TEXTS["docs/campaign.md"]]


def test_every_table_of_the_results_is_in_the_readme():
    stages = [stage for stage in contract.stages() if stage.startswith("tables/")]
    tables = [f"{stage.removeprefix('tables/')}.csv" for stage in [*stages, "summary"]]
    assert not [table for table in tables if f"`{table}`" not in TEXTS["README.md"]]


def test_every_flag_is_documented():
    from cellwright.series.cleaning import Flag

    assert not [
        flag.name for flag in Flag if f"`{flag.name.lower()}`" not in TEXTS["docs/cleaning.md"]
    ]


def test_no_page_is_too_long():
    """CONTRIBUTING.md says how long; results of seeds and what was tried belong to lab/."""
    (most,) = re.findall(r"at\s+most\s+([\d,]+)\s+words", TEXTS["CONTRIBUTING.md"])
    words = {
        page: len(pages.by_hand(ROOT / page).split()) for page in TEXTS if page.startswith("docs/")
    }
    assert not {page: n for page, n in words.items() if n > int(most.replace(",", ""))}


def test_every_page_has_one_place_in_the_navigation():
    of_docs = {path.removeprefix("docs/") for path in TEXTS if path.startswith("docs/")}
    assert sorted(NAVIGATION) == sorted({*of_docs, *pages.MADE, *pages.ELSEWHERE})


def test_pages_made_at_build_are_not_committed():
    assert not [file for file in pages.MADE if (ROOT / "docs" / file).exists()]


@pytest.mark.parametrize("path", COMMITTED, ids=name)
def test_what_is_made_of_a_committed_page_is_made_of_today(path):
    """`./run python scripts/documentation/pages.py` makes it anew."""
    assert path.read_bytes() == COMMITTED[path]


def test_words_of_what_is_made_are_not_counted(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("by hand\n\n<!-- made: ties -->\n\n| a | table |\n\n<!-- end -->\nmore\n")
    assert pages.by_hand(page).split() == ["by", "hand", "more"]
    assert pages.by_hand(ROOT / "docs" / "tables.md") == ""


def test_the_site_fetches_nothing_from_elsewhere():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert "font: false" in text
    assert "  - offline\n" in text
    assert "://" not in text


@pytest.mark.parametrize("source", TEXTS)
def test_every_link_leads_somewhere(source):
    """To a file of the repository, also where the site has a page that is made from it."""
    for link in LINK.findall(TEXTS[source]):
        path, _, anchor = link.partition("#")
        if re.match(r"https?:|mailto:", link):
            continue
        found = normpath(f"{source.rpartition('/')[0]}/{path}".lstrip("/")) if path else source
        assert (ROOT / found).exists(), f"{source}: {link} leads nowhere in the repository"
        if anchor:
            made = MADE.get(pages.STANDS_FOR.get(found, ""))
            text = made or (ROOT / found).read_text(encoding="utf-8")
            assert anchor in anchors(pages.with_parts(text)), f"{source}: {link}"


def test_every_page_that_code_and_comments_name_exists():
    """A path of a page by hand in a docstring, a message, a schema, a test."""
    folders = ("scripts", "workflow", "profiles", "lab", "tests", "plugins", "benchmarks", "config")
    kinds = {".py", ".pyi", ".c", ".h", ".smk", ".yaml", ".toml", ".md", ".j2"}
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*.*")]
    made = {"__pycache__", "results", "build"}
    read = [p for p in paths if p.is_file() and p.suffix in kinds and not made & set(p.parts)]
    read += [ROOT / ".snakemake-workflow-catalog.yml", ROOT / "run", ROOT / "container/Dockerfile"]
    page = re.compile(r"\b(?:docs|lab|benchmarks)/[\w/-]+\.md\b")
    named = {(one, name(p)) for p in read for one in page.findall(p.read_text(encoding="utf-8"))}
    assert len(named) > 50
    assert not sorted((one, where) for one, where in named if not (ROOT / one).exists())


def test_every_path_in_a_command_exists():
    """Scripts, tests and folders of the repository that the pages tell people to run or open."""
    inside = r"(?<![\w/.-])((?:scripts|lab|tests|benchmarks|plugins|container)/[\w./-]*\w)"
    for page, text in TEXTS.items():
        code = re.findall(r"^```.*?^```|`[^`\n]+`", text, re.M | re.S)
        paths = {path for block in code for path in re.findall(inside, block)}
        assert not sorted(p for p in paths - EXAMPLES if not (ROOT / p).exists()), page


def test_links_of_the_site_lead_to_pages_of_the_site():
    """A file of the repository that is a page leads there; code, which is none, is its path."""
    text = pages.for_site(
        "[a](../config/README.md#pack), [b](../CONTRIBUTING.md), "
        "[c](../run), [d](ocv.md#x), [run](../run)\n"
        "```\n[e](../run)\n```\n",
        "tutorial.md",
    )
    assert text.splitlines()[0] == (
        "[a](settings.md#pack), [b](contributing.md), c (`run`), [d](ocv.md#x), `run`"
    )
    assert "[e](../run)" in text
    linked = pages.for_site("[c](../run)", "tutorial.md", "address")
    assert linked == "[c](address/run)\n"


def test_what_belongs_to_an_entry_of_a_list_stays_in_it():
    code = ["", "   ```", "     code", "   ```", "2. two", "end", ""]
    source = ["1. one", "", "   more", "   * inner", "     goes on", *code]
    shifted = ["", "    ```", "      code", "    ```", "", "2. two", "end", ""]
    wanted = ["1. one", "", "    more", "", "    * inner", "        goes on", *shifted]
    assert pages.indented_by_four("\n".join(source)) == "\n".join(wanted)
    assert pages.indented_by_four("text\n    code\n") == "text\n    code\n"


@pytest.mark.parametrize("page", TEXTS)
def test_no_package_host_and_no_path_of_a_machine(page):
    assert not HOST.search(TEXTS[page])
    assert not MACHINE.search(TEXTS[page])
