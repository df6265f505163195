"""Small documents that starts keep for later ones, and can do without."""

import json
import tempfile
from pathlib import Path


def read(file) -> dict:
    """A kept document; empty where there is no file or no whole one."""
    try:
        document = json.loads(Path(file).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}


def write(file, document: dict) -> bool:
    """Whether the file could be written; other starts see all of it or nothing."""
    file = Path(file)
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryDirectory(dir=file.parent) as folder:
            whole = Path(folder, file.name)
            whole.write_text(json.dumps(document), encoding="utf-8")
            whole.replace(file)
    except OSError:
        return False
    return True
