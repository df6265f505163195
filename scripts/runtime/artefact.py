"""The only place that opens artefacts: load, save with provenance, check against the contract.

An artefact is a Parquet table (columns in the contract, facts in its metadata), a JSON document,
for people a CSV table, or for simulators a functional mock-up unit (.fmu). What could not be made
is an artefact too: no rows, and a reason that every later stage passes on, so that one bad file
never takes the others down.
"""

import csv
import io
import json
import sys
import traceback
import zipfile
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cellwright.messages import doubt_columns, doubts_in
from cellwright.refusal import Refusal
from runtime import contract, provenance
from runtime.csv_cells import as_written, guarded

KEY = b"cellwright"
IN_UNIT = "extra/cellwright/provenance.json"


class _Hidden:
    """An entry of `sys.meta_path` that lets the import of some packages fail."""

    def __init__(self, names):
        self.names = names

    def find_spec(self, name, path=None, target=None):
        if name in self.names:
            raise ModuleNotFoundError(f"{name} is not looked for here")


@contextmanager
def without(*names):
    """Within the block these packages cannot be imported, unless they already were."""
    hidden = _Hidden(names)
    sys.meta_path.insert(0, hidden)
    try:
        yield
    finally:
        sys.meta_path.remove(hidden)


# At its first array each way pyarrow imports pandas, to recognise pandas' own objects. There are
# none here, and the import takes most of a second of each of the run's hundreds of jobs.
with without("pandas"):
    pa.chunked_array([pa.array(np.zeros(1))]).to_numpy()

# Every job checks what it writes. Read here, the contract is there already in a process that was
# forked from one with this module; reading it takes 0.06 s of CPU, half of a small job.
contract.stages()


def columns_of(content) -> dict:
    """Columns from columns, a NamedTuple of arrays, a DataFrame, or a list of rows."""
    if hasattr(content, "to_dict"):
        return content.to_dict("list")
    if hasattr(content, "_asdict"):
        content = content._asdict()
    if not isinstance(content, dict):
        content = [row._asdict() if hasattr(row, "_asdict") else row for row in content]
        names = list(content[0]) if content else []
        content = {name: [row[name] for row in content] for name in names}
    return content


def write(path, content, about):
    """Write an artefact by its suffix, with `about`: provenance, reason, origin, notes, doubts,
    facts.

    Returns the table of a Parquet artefact, else None.
    """
    suffix = Path(path).suffix
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    if suffix == ".json":
        document = plain(content) | {"provenance": about}
        Path(path).write_text(json.dumps(document, indent=1), encoding="utf-8")
    elif suffix == ".csv":
        _write_csv(path, columns_of(content), about)
    elif suffix == ".svg":
        Path(path).write_text(_blank_figure(about), encoding="utf-8")
    elif suffix == ".fmu":
        _write_unit(path, content or b"", about)
    else:
        columns = columns_of(content)
        table = pa.table({name: _arrow(values) for name, values in columns.items()})
        text = json.dumps(about, sort_keys=True)
        # Readings hardly repeat: a dictionary of them takes four times as long and a fourth more.
        repeating = [field.name for field in table.schema if not pa.types.is_floating(field.type)]
        pq.write_table(
            table.replace_schema_metadata({KEY: text}),
            path,
            compression="zstd",
            compression_level=1,
            use_dictionary=repeating,
        )
        return table
    return None


def _admitted(path, content):
    """Columns of a Parquet artefact without rows that break its contract, and a sentence on each.

    All other content is as it was.
    """
    if Path(path).suffix != ".parquet":
        return content, []
    columns = columns_of(content)
    # What could not be made has no columns.
    return contract.admitted(contract.entry_of(path), columns) if len(columns) else (columns, [])


def _arrow(values):
    # Lists of several lengths, such as errors by test, stay lists in Parquet.
    ragged = len(values) and isinstance(values[0], list | tuple | np.ndarray)
    return pa.array([list(row) for row in values] if ragged else np.asarray(values))


def _write_csv(path, columns, about):
    contracted = contract.stages()[contract.entry_of(path)]["columns"]
    names = [name for name in contracted if "<" not in name]
    stems = tuple(name.split("<")[0] for name in contracted if "<" in name)
    names += [name for name in columns if name not in contracted and name.startswith(stems)]
    length = len(next(iter(columns.values()), []))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in zip(*(columns.get(name, [None] * length) for name in names), strict=True):
        writer.writerow([_cell(value) for value in row])
    Path(path).write_text(text.getvalue(), encoding="utf-8")
    Path(f"{path}.provenance.json").write_text(json.dumps(about, indent=1, sort_keys=True))


def _write_unit(path, content, about):
    """A functional mock-up unit, a zip archive, with `about` among its extras; no date in it."""
    Path(path).write_bytes(content)
    with zipfile.ZipFile(path, "a") as packed:
        entry = zipfile.ZipInfo(IN_UNIT, (1980, 1, 1, 0, 0, 0))
        entry.external_attr = 0o644 << 16
        packed.writestr(entry, json.dumps(about, indent=1, sort_keys=True))


def _blank_figure(about) -> str:
    """SVG with the reason why a figure could not be drawn."""
    from xml.sax.saxutils import escape

    return (
        '<svg xmlns="http://www.w3.org/2000/svg" width="648" height="40" viewBox="0 0 648 40">'
        f"<desc>{escape(json.dumps(about, sort_keys=True))}</desc>"
        f'<text x="8" y="24" font-family="sans-serif" font-size="11">{escape(about["reason"])}'
        "</text></svg>\n"
    )


def _cell(value):
    """A value of a CSV table, with nine digits: more than any instrument resolves; NaN is empty."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    if isinstance(value, str):
        # A bare carriage return is not quoted by the module csv, and ends a row to its reader.
        return guarded(value.replace("\r\n", "\n").replace("\r", "\n"))
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


FAILED = "Cellwright itself failed"  # begins the reasons that are no refusals


# What may be otherwise when a job is made again.
PASSING = (OSError, MemoryError)


def failure(error: Exception, where="at this step") -> str:
    """An exception that is no refusal, as a sentence for people; one that may pass is raised on."""
    if isinstance(error, PASSING):
        raise error
    said = f"{type(error).__name__}: {error}".removesuffix(": ")
    return f"{FAILED} {where} ({said}): a fault of the program, told in full in the step's log"


class Passed(Refusal):
    """A refusal made by an earlier stage, passed on by this one."""

    def __init__(self, reason: str, origin: str):
        super().__init__(reason)
        self.origin = origin


class Job:
    """Loads and saves of one script: `with artefact.Job(snakemake) as job: … job.save(columns)`.

    Of a script of several steps each step has a block of its own, with the outputs that it makes,
    so that what is refused in one step is refused there and in the steps that need its outcome.

    Parameters
    ----------
    outputs : of a step, the paths that it makes; by default all outputs of the job
    inputs : of a step, the paths that it reads; by default all inputs of the job
    after : the step before, whose tables are loaded from memory

    A refusal inside the block is written as the reason into every output that is not saved yet.
    So is any other exception, as a failure of the program with its traceback in the log: a fault in
    one cell's job must not cost the other cells their report, and the report names it on top.
    What may have passed by the next run, a fault of the disk or too little memory, fails the job,
    so that it is made again.
    """

    def __init__(self, snakemake, *outputs, inputs=None, after=None):
        self.snakemake = snakemake
        self.outputs = list(outputs or snakemake.output)
        self.inputs = snakemake.input if inputs is None else inputs
        self.step = contract.stage_of(outputs[0]) if outputs else None
        self.saved = set()
        self.made = dict(after.made) if after else {}
        self.notes = []

    def __enter__(self):
        if self.step:
            self.log(f"{', '.join(self.outputs)}\n")
        return self

    def __exit__(self, kind, error, trace):
        if error is None or not isinstance(error, Exception):
            return False
        if isinstance(error, PASSING):
            self.log("".join(traceback.format_exception(error)))
            return False
        expected = isinstance(error, Refusal)
        reason = str(error) if expected else failure(error)
        log = "".join(traceback.format_exception(error)) if not expected else reason + "\n"
        self.log(log)
        # Snakemake deletes all outputs of a job that fails: each must be there, with its reason.
        for path in self.outputs:
            if path not in self.saved:
                write(path, {}, self.about(reason, getattr(error, "origin", path)))
        return True

    def load(self, path) -> dict:
        """Content of an artefact. Raises Passed where the artefact carries a reason."""
        made = self.made.get(path)
        return load(path) if made is None else arrays_of(made)

    def save(self, content, path=None, **facts):
        """Write `content` (columns, rows or a JSON document) with facts beside it.

        `path` is one of the outputs (default: the only one).
        """
        path = path or self.outputs[0]
        content, beyond = _admitted(path, content)
        if beyond:
            self.note(*beyond)
            facts["left_out"] = [*facts.get("left_out", []), *beyond]
        about = self.about() | {"facts": plain(facts)}
        # What a table says of the tests behind it is already known by their names.
        known = {
            f"{test}: {one}" if test else one
            for of, test in ((of, of.partition(" ")[2]) for of in about["doubts"])
            for one in doubts_about(about, of)
        }
        own = [one for one in doubts_told(content, contract.stage_of(path)) if one not in known]
        if own:
            columns = doubt_columns(own)
            about["doubts"] |= {owner_of(about): columns["doubt"]}
            about["doubt_codes"] |= {owner_of(about): columns["doubt_codes"]}
        self.made[path] = write(path, content, about)
        self.saved.add(path)

    def note(self, *notes):
        """Sentences for the report about what was done or left out."""
        self.notes += notes
        self.log("".join(f"{note}\n" for note in notes))

    def log(self, text: str):
        """Write to the rule's log file; failures of the program go to the terminal as well."""
        for path in self.snakemake.log:
            with open(path, "a", encoding="utf-8") as file:
                file.write(text)
        if "Traceback" in text:
            sys.stderr.write(text)

    def about(self, reason=None, origin=None) -> dict:
        """Provenance, reason, origin, notes, doubts and facts that an artefact of this job carries.

        Doubts are those of whatever lies behind it; `moved_by` names the tests whose doubts move
        its numbers, see `behind`.
        """
        return provenance.record(self.snakemake, self.inputs) | {
            "step": self.step,
            "reason": reason,
            "origin": origin,
            "notes": [str(note) for note in self.notes],
            "notes_of": [getattr(note, "of", "") for note in self.notes],
            **behind(self.inputs),
            "facts": {},
        }


def doubts_told(content, code) -> list:
    """What a table's own column `doubt` says, once each: list of Said; empty where it has none.

    code : of sentences without one in a column `doubt_codes` beside them.
    """
    if not hasattr(content, "get") or content.get("doubt") is None or not len(content["doubt"]):
        return []
    values = np.asarray(content["doubt"])
    if np.issubdtype(values.dtype, np.integer):
        from cellwright.series.doubts import doubts_said

        return doubts_said(values)
    codes = content.get("doubt_codes", [None] * len(values))
    pairs = dict.fromkeys(zip(values.tolist(), codes, strict=True))
    rows = [{"doubt": words, "doubt_codes": found} for words, found in pairs]
    return list(dict.fromkeys(one for row in rows for one in doubts_in(row, code)))


def doubts_about(about, of) -> list:
    """What an artefact knows that speaks against "cell test": list of Said."""
    row = {"doubt": about["doubts"][of], "doubt_codes": about.get("doubt_codes", {}).get(of)}
    return doubts_in(row)


def owner_of(about) -> str:
    """Key of a doubt: "cell test", or "group test", of the artefact that these facts are of."""
    wildcards = about.get("wildcards", {})
    owner = wildcards.get("cell") or wildcards.get("group", "")
    return f"{owner} {wildcards.get('test', '')}"


# Stages of one test that are the record itself, whose numbers are then fitted.
OF_RECORDS = ("ingest", "clean", "segment", "repeats")


def behind(paths) -> dict:
    """What stands behind a job's artefacts, by what it reads.

    doubts, doubt_codes : columns of that name by "cell test", of everything. records : tests that
    its numbers are fitted to or counted from, also through a model. moved_by : those, and tests of
    which it reads a number (a capacity, a resistance): a doubt moves what is made of that number,
    and nothing further on. What
    came in time before a test (stage `course`) moves nothing of it; nor do the slow tests and
    spectra that a search for effects holds beside the records that a model is fitted to.
    """
    doubts, codes, records, numbers = {}, {}, set(), set()
    for path in sorted(set(map(str, paths))):
        if "results" not in Path(path).parts or Path(path).suffix not in (".parquet", ".json"):
            continue
        about, stage = read_about(path), contract.stage_of(path)
        doubts |= about.get("doubts", {})
        codes |= about.get("doubt_codes", {})
        if about.get("wildcards", {}).get("test"):
            (records if stage in OF_RECORDS else numbers).add(owner_of(about))
        elif stage not in ("course", "missing_effect"):
            records |= set(about.get("records", ()))
    return {
        "doubts": doubts,
        "doubt_codes": codes,
        "records": sorted(records),
        "moved_by": sorted(records | numbers),
    }


def load(path) -> dict:
    """Columns of a Parquet artefact (name → array) or content of a JSON one.

    Raises
    ------
    Passed
        Where the artefact is empty for a reason.
    """
    about = read_about(path)
    if about["reason"] is not None:
        raise Passed(about["reason"], about["origin"])
    if Path(path).suffix == ".json":
        return {key: value for key, value in _read_json(path).items() if key != "provenance"}
    with pq.ParquetFile(path) as file:
        return arrays_of(file.read(use_threads=False))


def arrays_of(table) -> dict:
    """Columns of an Arrow table: name → array."""
    return {name: table[name].to_numpy() for name in table.column_names}


def load_all(paths) -> list[tuple[dict, dict]]:
    """(content, about) of each artefact that is not empty for a reason, in the order given."""
    abouts = [(path, read_about(path)) for path in paths]
    return [(load(path), about) for path, about in abouts if about["reason"] is None]


def load_first(paths):
    """Content of the first artefact that is not empty for a reason; None where there is none."""
    return next((content for content, _ in load_all(paths)), None)


def load_some(paths) -> list[tuple[dict, dict]]:
    """As `load_all`, for where at least one is needed.

    Raises
    ------
    Passed
        With the first artefact's reason, where all are empty for a reason.
    """
    loaded = load_all(paths)
    if not loaded:
        load(paths[0])
    return loaded


def load_together(pairs) -> list[tuple[dict, dict, dict]]:
    """(first, second, about of the second) of each pair of artefacts where both have content.

    Raises
    ------
    Passed
        With the first reason, where no pair has content.
    """
    pairs = list(pairs)
    abouts = [[read_about(path) for path in pair] for pair in pairs]
    loaded = [
        (load(first), load(second), about[1])
        for (first, second), about in zip(pairs, abouts, strict=True)
        if all(metadata["reason"] is None for metadata in about)
    ]
    if not loaded:
        for path in (path for pair in pairs for path in pair):
            load(path)
    return loaded


def load_table(path) -> list[dict]:
    """Rows of a CSV table as text, an empty cell for what is not known."""
    with open(path, encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file)
        return [{name: as_written(cell) for name, cell in row.items()} for row in rows]


def split(result) -> tuple[dict, dict]:
    """Columns and facts of a NamedTuple: its arrays, and everything else."""
    fields = result._asdict()
    arrays = {name: value for name, value in fields.items() if isinstance(value, np.ndarray)}
    return arrays, {name: value for name, value in fields.items() if name not in arrays}


def rows(columns: dict) -> list[dict]:
    """Columns as a list of rows of plain Python values."""
    lists = {name: np.asarray(values).tolist() for name, values in columns.items()}
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]


def read_about(path) -> dict:
    """Provenance, reason, origin, notes and facts that an artefact carries; a table, beside it."""
    if Path(path).suffix == ".csv":
        return json.loads(Path(f"{path}.provenance.json").read_text(encoding="utf-8"))
    if Path(path).suffix == ".json":
        return _read_json(path)["provenance"]
    if Path(path).suffix == ".fmu":
        with zipfile.ZipFile(path) as packed:
            return json.loads(packed.read(IN_UNIT))
    return json.loads(pq.read_schema(path).metadata[KEY])


def _read_json(path) -> dict:
    about = Path(path).stat()
    return _json_of_version(path, about.st_mtime_ns, about.st_size, about.st_ino)


@cache
def _json_of_version(path, *version) -> dict:
    """A document, read anew where its file has another time, size or inode than before.

    What it says of itself and its content are read one after the other.
    """
    return json.loads(Path(path).read_text(encoding="utf-8"))
