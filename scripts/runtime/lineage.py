"""What artefacts were made from, back to the raw files: read from what each carries."""

import json
from pathlib import Path
from typing import NamedTuple

from runtime import artefact, provenance


class Link(NamedTuple):
    """A file and how it was made.

    Attributes
    ----------
    path : of the file, from the campaign's folder
    sha256 : of its bytes when the next step read them; None of the last one
    about : its provenance, see `artefact.Job.about`; None of a raw file
    depth : steps between it and the last one
    repeated : whether it was named before, where what it was made from stands
    """

    path: str
    sha256: str | None
    about: dict | None
    depth: int
    repeated: bool


def about_of(path) -> dict | None:
    """The provenance that a file of the results carries; None of one that carries none."""
    at, beside = Path(path), Path(f"{path}.provenance.json")
    if "results" not in at.parts or not at.is_file():
        return None
    if at.suffix == ".csv" and not beside.is_file():
        return None
    if at.suffix == ".json":
        return json.loads(at.read_text(encoding="utf-8")).get("provenance")
    return artefact.read_about(path) if at.suffix in (".parquet", ".fmu", ".csv") else None


def links_to(path, wanted=lambda path: True) -> list[Link]:
    """All files that a file was made from, each below what was made from it, raw files last.

    Parameters
    ----------
    path : of a table or an artefact, from the campaign's folder
    wanted : which inputs of tables to follow, such as those of one cell
    """
    links, seen = [], set()

    def follow(path, sha256, depth, chosen):
        about = about_of(path)
        links.append(Link(path, sha256, about, depth, path in seen))
        known = path in seen
        seen.add(path)
        if about is None or known:
            return
        for source, digest in sorted(about["inputs"].items()):
            if chosen(source):
                # A table of tables is of all cells, an artefact in between of its own alone.
                of_many = Path(source).suffix == ".csv"
                follow(source, digest, depth + 1, chosen if of_many else lambda source: True)

    follow(str(path), None, 0, wanted)
    return links


MANIFEST = Path("results", "stages", "manifest.tsv")
EDITED = "EDITED: not as the manifest of the run says (by hand, or made anew without it)"


def is_edited(path) -> bool:
    """Whether the manifest of the campaign, the working folder, has other bytes of a file."""
    if not MANIFEST.is_file() or not Path(path).is_file():
        return False
    lines = MANIFEST.read_text(encoding="utf-8").splitlines()
    digests = {file: digest for digest, file in (line.split("\t") for line in lines)}
    known = digests.get(Path(path).as_posix())
    return known is not None and provenance.sha256_of.__wrapped__(path) != known


def state_of(link: Link) -> str:
    """Whether a file still has the bytes that the next step read; the last one those of the run."""
    if not Path(link.path).is_file():
        return "missing"
    if link.sha256 is None:
        return EDITED if is_edited(link.path) else ""
    # Read anew: a checksum that was kept is that of a file before it was edited.
    same = provenance.sha256_of.__wrapped__(link.path) == link.sha256
    return "unchanged" if same else "CHANGED since it was read"
