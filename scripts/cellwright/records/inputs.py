"""Arguments of public steps as the science takes them: columns, rows, facts, settings."""

import difflib
from collections.abc import Mapping
from numbers import Real

from cellwright import gate
from cellwright.records.facts import BranchFacts, CellFacts, MeasuredTest, TestFacts
from cellwright.refusal import Refusal
from cellwright.result import UNITS
from cellwright.series.steps import Steps

# Every record has these; a clean one is also counted, since an instrument's own counter may be
# reset within a test.
NAMES = ("test_time_second", "current_ampere", "voltage_volt")
COUNTED = (*NAMES, "charge_ampere_hour")
CUTOFFS = ("lower_cutoff_volt", "upper_cutoff_volt")
# Fields by which a document is known for what it is: any JSON file has the right suffix.
BASIS = ("capacity_ampere_hour", "ocv")


# Steps of the method that make a column which others lack.
MADE_BY = {"charge_ampere_hour": "clean", "start_time_second": "ageing_cycles"}


# Columns of the sheets that no step needs: a row of a sheet is facts as it stands.
FURTHER = {
    CellFacts: (
        *("chemistry", "reference", "ageing_protocol", "negative_half_cell", "positive_half_cell"),
        *("model_table", "model_capacity_ampere_hour", "note"),
    ),
    TestFacts: (
        *("cell", "file", "instrument", "current_sign", "columns", "sha256", "simulated_file"),
        "note",
    ),
    BranchFacts: ("group", "connection", "link_resistance_ohm", "terminals", "sense"),
}
# What a column holds that is no numbers, by numpy's kind of it, and how it becomes numbers.
OTHERS = {
    "M": ("a date", "wanted seconds: subtract the first date and take .dt.total_seconds()"),
    "m": ("a duration", "wanted a number: take .dt.total_seconds()"),
    "b": ("true or false", "wanted a number"),
    "c": ("a complex number", "wanted a real one"),
}
TEXT = ("a text", "wanted a number: pandas.to_numeric makes one of it")


def columns(series, *needed) -> dict:
    """Columns by name, (n,) arrays, of a DataFrame, a mapping, or a result with columns.

    A record with labels of its own (`Time [s]`) is read as the csv of it would be. Refused are a
    column of `needed` that is not there, columns of different lengths, and where any is needed,
    columns in a unit that hold no numbers.
    """
    arrays = _arrays(series)
    if labelled(series, needed):
        from cellwright.series.joining import of_labels

        arrays = of_labels(series).columns
    lacking = [name for name in needed if name not in arrays]
    if lacking:
        made = [f"; `{MADE_BY[name]}` makes it" for name in lacking if name in MADE_BY][:1]
        raise Refusal(
            f"no column {', '.join(lacking)}{''.join(made)}; there are {', '.join(arrays)}"
        )
    sizes = {name: len(values) for name, values in arrays.items() if values.ndim}
    if len(set(sizes.values())) > 1:
        raise Refusal(f"columns of different lengths: {sizes}")
    if needed:
        arrays = {name: _numbers(name, values) for name, values in arrays.items()}
    return arrays


def _arrays(series):
    import numpy as np

    return {str(name): np.asarray(values) for name, values in _by_name(series).items()}


def labelled(series, needed=NAMES) -> bool:
    """Whether a table lacks a column of a record, and has enough labels that are none of ours."""
    names = list(map(str, _by_name(series)))
    lacks = set(needed).intersection(NAMES).difference(names)
    index = getattr(getattr(series, "index", None), "names", ())
    enough = len(names) + len([name for name in index if name is not None]) >= len(NAMES)
    return bool(lacks) and enough and not all(name.endswith(tuple(UNITS)) for name in names)


def _numbers(name, values):
    """A column as numbers, (n,); a blank is NaN. Refused is what is none, with its first row."""
    import numpy as np

    if name in COUNTED and values.ndim != 1:
        raise Refusal(f"column {name}: found {values.ndim} dimensions, wanted one number a row")
    kind = values.dtype.kind
    if kind in "fiu" or not values.ndim or not name.endswith(tuple(UNITS)):
        return values
    bad = 0
    if kind == "O":
        blank = [v is None or type(v).__name__ in ("NAType", "NaTType") for v in values]
        fits = [isinstance(v, Real) and not isinstance(v, bool) for v in values]
        bad = next((k for k, fit in enumerate(fits) if not (fit or blank[k])), None)
        if bad is None:
            return np.array([np.nan if b else v for v, b in zip(values, blank, strict=True)], float)
    if not len(values):
        return values.astype(float)
    what, wanted = OTHERS.get(kind, TEXT)
    shown = repr(str(values[bad])) if kind in "OUS" else values[bad]
    raise Refusal(f"column {name}, row {bad + 1}: found {shown}, {what}; {wanted}")


def _by_name(series):
    # The order matters: a result is a NamedTuple that may have a table `columns`, and a DataFrame
    # has `columns` that are no mapping.
    if isinstance(series, Mapping):
        return series
    inner = getattr(series, "columns", None)
    if isinstance(inner, Mapping):
        return inner
    if hasattr(series, "_asdict"):
        return series._asdict()
    if hasattr(series, "to_numpy"):  # a DataFrame, recognised without loading pandas
        return {name: series[name].to_numpy() for name in inner}
    raise Refusal(f"{type(series).__name__} is no DataFrame and no mapping of columns")


def quantities(series, names=NAMES) -> list:
    """List of the named columns, (n,) each, in this order."""
    arrays = columns(series, *names)
    return [arrays[name] for name in names]


def table_of(kind, table):
    """A NamedTuple of columns, as it is or from a result with rows, a DataFrame or a mapping.

    Columns that have a default may be absent; further ones are left out.
    """
    table = getattr(table, "rows", table)
    if isinstance(table, kind):
        return table
    given = columns(table, *(n for n in kind._fields if n not in kind._field_defaults))
    return kind(**{name: given[name] for name in kind._fields if name in given})


def steps(table):
    """Steps of a record from the result of `segment`, a DataFrame or a mapping of its columns."""
    return table_of(Steps, table)


def rows(table) -> list[dict]:
    """Rows as dicts of plain values: of a list of rows, a result, a DataFrame or columns."""
    if _is_list(table):
        return [row._asdict() if hasattr(row, "_asdict") else row for row in table]
    inner = getattr(table, "rows", None)
    if inner is not None:
        return rows(inner)
    plain = {name: values.tolist() for name, values in columns(table).items()}
    return [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]


def _is_list(table):
    # A NamedTuple of columns is a tuple as well, but one table and no list of rows.
    return isinstance(table, list | tuple) and not hasattr(table, "_asdict")


def entries(table, fields=rows) -> list[dict]:
    """Rows as dicts, those of (test, result) each with name, temperature and cycle of their test.

    table : (TestFacts or mapping, result) each, among them rows as they are; or as of `rows`.
    fields : function, result → list of dicts of plain values.
    """
    if not _is_list(table):
        return rows(table)
    dated = []
    for pair in table:
        if isinstance(pair, Mapping):
            dated.append(pair)
            continue
        facts, names = test_facts(pair[0]), ("test", "ambient_temperature_celsius", "cycle")
        dated += [{name: getattr(facts, name) for name in names} | r for r in fields(pair[1])]
    return dated


def curves_of(result):
    """The OCV curve of a result as plain lists; of rests with the source of its capacity."""
    curve = {
        name: value.tolist() if hasattr(value, "tolist") else value
        for name, value in result.curve._asdict().items()
    }
    source = getattr(result, "capacity_source", None)
    return [curve if source is None else curve | {"capacity_source": source}]


def cell_facts(cell):
    """CellFacts as they are, or from a mapping with more or fewer keys."""
    return _facts(CellFacts, cell)


def test_facts(test):
    """TestFacts as they are, or from a mapping with more or fewer keys."""
    return _facts(TestFacts, {"test": "", **test} if isinstance(test, Mapping) else test)


def branch_facts(branch):
    """BranchFacts as they are, or from a row of groups.tsv."""
    return _facts(BranchFacts, branch)


def _facts(kind, values):
    if isinstance(values, kind):
        return values
    if not isinstance(values, Mapping):
        raise Refusal(f"found a {type(values).__name__}, wanted {kind.__name__} or a mapping")
    lacking = [n for n in kind._fields if n not in values and n not in kind._field_defaults]
    if lacking:
        raise Refusal(f"{kind.__name__} needs {', '.join(lacking)}; given are {', '.join(values)}")
    known = (*kind._fields, *FURTHER[kind])
    if unknown := [str(name) for name in values if name not in known]:
        near = difflib.get_close_matches(unknown[0], known, n=1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise Refusal(f"{kind.__name__} has no {', '.join(unknown)}{meant}")
    # A blank in a DataFrame is NaN, in a sheet None.
    given = {n: None if values[n] != values[n] else values[n] for n in kind._fields if n in values}
    for name, value in given.items():
        number = name.endswith(tuple(UNITS)) or name in ("soc", "cycle", "state_of_health")
        if number and value is not None and not isinstance(value, Real):
            raise Refusal(f"{kind.__name__}, {name}: found {value!r}, wanted a number")
    return kind(**given)


def cutoffs(cell) -> dict:
    """Limits of a cell's voltage [V] as keywords."""
    facts = cell_facts(cell)
    return {name: getattr(facts, name) for name in CUTOFFS}


def ratings(cell) -> dict:
    """Rated capacity [Ah] and limits of a cell's voltage [V] as keywords."""
    # Blank in the sheet is None: each step says itself what it can do without.
    return {"rated_capacity_ampere_hour": rating(cell), **cutoffs(cell)}


def rating(cell) -> float | None:
    """Rated capacity of a cell [Ah], None where not stated."""
    return cell_facts(cell).rated_capacity_ampere_hour


def measured(test, series, needed=NAMES):
    """MeasuredTest of TestFacts or a mapping, and the columns of its series."""
    return MeasuredTest(test_facts(test), columns(series, *needed))


def tests(pairs) -> list:
    """MeasuredTest of pairs (TestFacts or mapping, clean series)."""
    return [measured(*pair, COUNTED) for pair in pairs]


def content(document):
    """The plain document of a result, or of the file of a path; a mapping or None as it is."""
    # A step may give tables only: then the result itself is no document.
    inner = getattr(document, "content", None)
    inner = document if inner is None else inner
    return json_of_file(inner) if is_path(inner) else inner


def basis(document):
    """Content of a basis: of a result, a document, a model, or path of `results/stages/basis/`.

    Anything else is refused with what it is.
    """
    wanted = "a result of `basis`, its results/stages/basis/<cell>.json, or a model"
    return with_fields(document, content(document), BASIS, wanted)


def with_fields(document, found, fields, wanted):
    """`found`, refused where it has not these fields; `document` is what the user gave."""
    if isinstance(found, Mapping) and all(name in found for name in fields):
        return found
    place = f"{document}: " if is_path(document) else ""
    raise Refusal(f"{place}found {in_words(found)}, wanted {wanted}")


def in_words(document):
    """What a document is: its schema, else its first five fields, else its type."""
    if not isinstance(document, Mapping):
        return "nothing" if document is None else f"a {type(document).__name__}"
    if "schema" in document:
        return f"a document of schema {document['schema']}"
    names = list(map(str, document))
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"a document of {', '.join(names[:5]) or 'nothing'}{more}"


def is_path(given):
    """Whether something given is the path of a file, as text or as a path."""
    return isinstance(given, str) or hasattr(given, "__fspath__")


def json_of_file(path):
    """Content of a JSON file that a user names, without the provenance of an artefact.

    Refused are no such file, a pipe or device, or no JSON in it; an artefact without content with
    its own reason.
    """
    import json

    data = gate.contents(path)
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise Refusal(f"{path}: {error}, wanted a JSON document") from error
    # What an artefact says of how it was made is no part of the document, and changes no result.
    about = document.get("provenance") if isinstance(document, dict) else None
    if not isinstance(about, dict):
        return document
    if about.get("reason"):
        raise Refusal(f"{path} holds nothing: {about['reason']}")
    return {name: value for name, value in document.items() if name != "provenance"}


def settings_of(kind, settings, changes):
    """Settings of a step: the defaults or `settings`, with single keys changed.

    kind : class of `cellwright.settings`. settings : None, a value of `kind`, or a mapping.
    changes : dict of single keys.

    Refused are an unknown key, and a mapping that lacks one: a campaign's choice must not be
    replaced by a default unnoticed.
    """
    if isinstance(settings, Mapping):
        lacking = [name for name in kind._fields if name not in settings]
        if lacking:
            raise Refusal(f"settings {kind.__name__} lack {', '.join(lacking)}")
        settings, changes = None, {**settings, **changes}
    if settings is not None and not isinstance(settings, kind):
        raise Refusal(f"settings are {type(settings).__name__}, wanted {kind.__name__}")
    value, unknown = settings or kind(), [name for name in changes if name not in kind._fields]
    if unknown:
        known = ", ".join(kind._fields)
        raise Refusal(f"{kind.__name__} has no setting {', '.join(unknown)}; it has {known}")
    return value._replace(**{k: tuple(v) if isinstance(v, list) else v for k, v in changes.items()})
