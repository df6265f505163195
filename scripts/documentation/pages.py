"""What of the documentation is made from the code, and pages of the site that are no file of docs/.

./run python scripts/documentation/pages.py

writes the pages, pictures and parts that are committed as they are made today.
"""

import re
import sys
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath

from documentation import (
    api_page,
    artefacts_page,
    demo_numbers,
    library_tables,
    rooms,
    rules_page,
    settings_page,
    tables_page,
)
from real_cells import page as real_cells_page

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.append(str(ROOT / "benchmarks"))  # its tables are made where they are measured

import as_page  # noqa: E402
import whole_run_page  # noqa: E402

# Committed in docs/ as they are made, for those who read the repository.
COMMITTED = {"settings.md": settings_page.text, "tables.md": tables_page.text}
PICTURES = {
    "pictures/architecture.svg": rooms.picture,
    "pictures/whole-runs.svg": whole_run_page.picture,
}
# Made when the site is built.
MADE = {
    "artefacts.md": artefacts_page.text,
    "rules.md": rules_page.text,
    "reference.md": api_page.text,
    "real-cells.md": real_cells_page.of_record,
}
# What stands in a page between the lines `<!-- made: name -->` and `<!-- end -->`.
MADE_PARTS = {
    "rooms": rooms.table,
    "picture of the rooms": lambda: "![Rooms and what they import](pictures/architecture.svg)",
    "benchmarks": as_page.tables,
    "picture of whole runs": lambda: "![CPU time by kind of work](../docs/pictures/whole-runs.svg)",
    "whole runs": whole_run_page.tables,
    "effects of a cell": library_tables.of_cell,
    "effects of a branch": library_tables.of_branch,
    "ties": library_tables.ties,
    "parts": library_tables.parts,
    "half cells": library_tables.of_half_cells,
    "demo of C1": demo_numbers.of_first,
    "demo cells": demo_numbers.of_cells,
    "demo search": demo_numbers.of_search,
}
# Files elsewhere in the repository that are pages of the site too.
ELSEWHERE = {
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "small-campaigns.md": "tests/campaigns/README.md",
    "demo-data.md": "data/README.md",
    "warm-executor.md": "plugins/snakemake-executor-plugin-warm/README.md",
    "functional-mock-up-units.md": "plugins/cellwright-fmu/README.md",
    "benchmarks.md": "benchmarks/README.md",
    "laboratory.md": "lab/README.md",
    "methods.md": "lab/methods.md",
    "results.md": "lab/results.md",
    "missing-effects-results.md": "lab/missing-effects.md",
}
# Files and folders that a link leads to in the repository, and the page that it leads to on the
# site: there it is made from them.
STANDS_FOR = {
    "README.md": "README.md",
    "config/README.md": "settings.md",
    "workflow/schemas/config.schema.yaml": "settings.md",
    "workflow/schemas/artefacts.yaml": "artefacts.md",
    "workflow/schemas": "settings.md",
    "workflow/rules": "rules.md",
    "scripts/cellwright/__init__.pyi": "reference.md",
    "docs/real-cells": "real-cells.md",
}
PART = re.compile(r"^<!-- made: ([\w ]+) -->\n(.*?)^<!-- end -->$", re.M | re.S)
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"^ *```.*?^ *```", re.M | re.S)
SOURCE = re.compile(r"\bdocs/([\w-]+)\.md\b")


def source_of(page: str) -> str:
    """Path in the repository of a page of the site; pages that are made count as files of docs/."""
    return ELSEWHERE.get(page, f"docs/{page}")


def text_of(page: str) -> str:
    """Markdown of a page that is no file of docs/."""
    if page in ELSEWHERE:
        return (ROOT / ELSEWHERE[page]).read_text(encoding="utf-8")
    return SOURCE.sub(r"[\1](\1.md)", MADE[page]())


def with_parts(markdown: str) -> str:
    """A page with the parts in it as they are made today, between their marks."""
    return PART.sub(_part, markdown)


def _part(found) -> str:
    text = MADE_PARTS[found[1]]().strip("\n")
    return f"<!-- made: {found[1]} -->\n\n{text}\n\n<!-- end -->"


def by_hand(page) -> str:
    """What a person wrote of a page (a path): without the parts that are made; "" of made pages."""
    if page.parent == DOCS and page.name in COMMITTED:
        return ""
    return PART.sub("", page.read_text(encoding="utf-8"))


def committed() -> dict:
    """Bytes of each committed file that is made, or has parts that are, as made today, by path."""
    found = {DOCS / name: SOURCE.sub(r"[\1](\1.md)", of()) for name, of in COMMITTED.items()}
    found |= {DOCS / name: draw() for name, draw in PICTURES.items()}
    for path in [*DOCS.glob("*.md"), ROOT / "README.md", *(ROOT / f for f in ELSEWHERE.values())]:
        text = path.read_text(encoding="utf-8")
        if PART.search(text):
            found[path] = with_parts(text)
    return {path: t if isinstance(t, bytes) else t.encode() for path, t in found.items()}


def for_site(markdown: str, page: str, repository: str = "") -> str:
    """Markdown of a page as the site needs it: parts made, lists set apart, links of the site.

    A link to a file of the repository leads to its page; one to code, which has none, leads to
    `repository` (the address of its files), or becomes its path where that is blank.
    """
    markdown = indented_by_four(with_parts(markdown))
    done, last = [], 0
    for fence in FENCE.finditer(markdown):
        done += [_prose(markdown[last : fence.start()], page, repository), fence[0]]
        last = fence.end()
    return "".join([*done, _prose(markdown[last:], page, repository)])


def indented_by_four(markdown: str) -> str:
    """What belongs to an entry of a list by four blanks a level, as Python's Markdown wants it.

    In the sources it is indented as far as the entry's text: two blanks, three after a number.
    Behind an entry of several paragraphs the next one needs a blank line.
    """
    out, entries, fenced, paragraphs = [], [], False, False
    for line in markdown.splitlines():
        words = line.lstrip(" ")
        indent = len(line) - len(words)
        while entries and words and not fenced and indent < entries[-1]:
            entries.pop()
        marker = None if fenced else re.match(r"(?:[*+-]|\d+\.) +(?=\S)", words)
        paragraphs = bool(entries or marker) and (paragraphs or not words)
        if marker and paragraphs and out and out[-1]:
            out.append("")
        inside = entries[-1] if entries else 0
        out.append(" " * (4 * len(entries) + max(0, indent - inside)) + words if words else "")
        if words.startswith("```"):
            fenced = not fenced
        if marker:
            entries.append(indent + len(marker[0]))
    return "\n".join([*out, ""])


def _prose(markdown: str, page: str, repository: str) -> str:
    """Links of the site; a blank line before each list, which Python's Markdown wants."""
    markdown = re.sub(r"(?m)^((?![*\-|>\s]|\d+\.).+\n)(?=(?:[*-]|1\.) )", r"\1\n", markdown)
    return LINK.sub(lambda link: _link(link, page, repository), markdown)


def _link(link, page: str, repository: str) -> str:
    mark, label, target = link.groups()
    path, separator, anchor = target.partition("#")
    if not path or re.match(r"[a-z]+:", target):
        return link[0]
    folder = PurePosixPath(source_of(page)).parent
    found = normpath((folder / path).as_posix())
    on_site = {source: name for name, source in ELSEWHERE.items()} | STANDS_FOR
    if found in on_site or found.startswith("docs/"):
        goal = on_site.get(found, found.removeprefix("docs/"))
        start = PurePosixPath(page).parent.as_posix()
        return f"{mark}[{label}]({relpath(goal, start)}{separator}{anchor})"
    if not (ROOT / found).exists():
        return link[0]  # leads nowhere: MkDocs says so
    return f"[{label}]({repository}/{found})" if repository else _named(label, found)


def _named(label: str, path: str) -> str:
    """A file of code in words: its path in place of its name, or behind other words."""
    if path.endswith(label.replace("\\", "").strip("`")):
        return f"`{path}`"
    return f"{label} (`{path}`)"


def renew():
    """Write what is committed as it is made today; prints the path of each file that changes."""
    for path, content in committed().items():
        if not path.exists() or path.read_bytes() != content:
            path.write_bytes(content)
            print(f"written: {path.relative_to(ROOT)}")


if __name__ == "__main__":
    renew()
