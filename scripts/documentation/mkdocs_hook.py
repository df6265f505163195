"""MkDocs' hook: adds the pages that are made, leads links to pages of the site, draws formulas."""

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.structure.files import File

from documentation import pages

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.S)


def on_files(files, config):
    """Add pages that are no files of docs/."""
    for page in [*pages.MADE, *pages.ELSEWHERE]:
        files.append(File.generated(config, page, content=pages.text_of(page)))
    return files


def on_page_markdown(markdown, page, config, files):
    """The Markdown of each page as the site needs it."""
    address = (config.repo_url or "").rstrip("/")
    repository = f"{address}/blob/main" if address else ""
    return pages.for_site(markdown, page.file.src_uri, repository)


def on_page_content(html, page, config, files):
    """Formulas in LaTeX as MathML, which browsers show without a script."""
    return FORMULA.sub(_formula, html)


def _formula(found) -> str:
    return convert(unescape(found[3]), display="block" if found[2] == "[" else "inline")
