"""MkDocs' hook: adds the pages that are made, and leads every link to a page of the site."""

from mkdocs.structure.files import File

from documentation import pages


def on_files(files, config):
    """Add pages and pictures that are no files of docs/."""
    for page in [*pages.MADE, *pages.ELSEWHERE]:
        files.append(File.generated(config, page, content=pages.text_of(page)))
    for picture, draw in pages.MADE_PICTURES.items():
        files.append(File.generated(config, picture, content=draw()))
    return files


def on_page_markdown(markdown, page, config, files):
    """The Markdown of each page as the site needs it."""
    address = (config.repo_url or "").rstrip("/")
    repository = f"{address}/blob/main" if address else ""
    return pages.for_site(markdown, page.file.src_uri, repository)
