"""How artefacts lie on the disk: Parquet, JSON and CSV, with what they say of themselves."""

import csv
import io
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import contract

KEY = b"cellwright"


def _settle_without_pandas():
    """Let pyarrow find, once, that there is no pandas.

    It looks for pandas at its first array each way, to recognise pandas' own objects. Nothing
    here has any, and the import takes most of a second of each of the run's hundreds of jobs.
    """
    if "pandas" in sys.modules:
        return
    blind = SimpleNamespace(find_spec=_no_pandas)
    sys.meta_path.insert(0, blind)
    try:
        pa.chunked_array([pa.array(np.zeros(1))]).to_numpy()
    finally:
        sys.meta_path.remove(blind)


def _no_pandas(name, path=None, target=None):
    if name == "pandas":
        raise ModuleNotFoundError("pandas is not looked for here")


_settle_without_pandas()


def columns_of(content) -> dict:
    """Columns from columns, a NamedTuple of arrays, or a list of rows."""
    if hasattr(content, "_asdict"):
        content = content._asdict()
    if not isinstance(content, dict):
        content = [row._asdict() if hasattr(row, "_asdict") else row for row in content]
        names = list(content[0]) if content else []
        content = {name: [row[name] for row in content] for name in names}
    return content


def stage_of(path) -> str:
    """The stage an artefact belongs to: the folder below `results`."""
    parts = Path(path).parts
    return parts[parts.index("results") + 1]


def write(path, content, about):
    suffix = Path(path).suffix
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    if suffix == ".json":
        document = plain(content) | {"provenance": about}
        Path(path).write_text(json.dumps(document, indent=1), encoding="utf-8")
    elif suffix == ".csv":
        _write_csv(path, columns_of(content), about)
    elif suffix == ".svg":
        Path(path).write_text(_blank_figure(about), encoding="utf-8")
    else:
        columns = columns_of(content)
        if about["reason"] is None and len(columns):
            contract.check(contract.entry_of(path), columns)
        table = pa.table({name: _arrow(values) for name, values in columns.items()})
        text = json.dumps(about, sort_keys=True)
        pq.write_table(
            table.replace_schema_metadata({KEY: text}),
            path,
            compression="zstd",
            compression_level=1,
        )


def _arrow(values):
    ragged = len(values) and isinstance(values[0], list | tuple | np.ndarray)
    return pa.array([list(row) for row in values] if ragged else np.asarray(values))


def _write_csv(path, columns, about):
    known = contract.stages()[contract.entry_of(path)]["columns"]
    names = [name for name in known if "<" not in name]
    stems = tuple(name.split("<")[0] for name in known if "<" in name)
    names += [name for name in columns if name not in known and name.startswith(stems)]
    length = len(next(iter(columns.values()), []))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in zip(*(columns.get(name, [None] * length) for name in names), strict=True):
        writer.writerow([_cell(value) for value in row])
    Path(path).write_text(text.getvalue(), encoding="utf-8")
    Path(f"{path}.provenance.json").write_text(json.dumps(about, indent=1, sort_keys=True))


def _blank_figure(about) -> str:
    """A figure that could not be drawn says why."""
    from xml.sax.saxutils import escape

    return (
        '<svg xmlns="http://www.w3.org/2000/svg" width="648" height="40" viewBox="0 0 648 40">'
        f"<desc>{escape(json.dumps(about, sort_keys=True))}</desc>"
        f'<text x="8" y="24" font-family="sans-serif" font-size="11">{escape(about["reason"])}'
        "</text></svg>\n"
    )


def _cell(value):
    """Nine digits are more than any instrument here resolves; not known is an empty cell."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return f"{value:.9g}" if isinstance(value, float) else value


def plain(value):
    """Value as JSON knows it; NaN and infinity, which JSON does not know, as null."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
