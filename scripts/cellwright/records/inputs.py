"""Arguments of public steps as the science takes them: columns, rows, facts, settings."""

from collections.abc import Mapping

from cellwright import gate
from cellwright.records.facts import BranchFacts, CellFacts, MeasuredTest, TestFacts
from cellwright.refusal import Refusal
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


def columns(series, *needed) -> dict:
    """Columns by name, (n,) arrays, of a DataFrame, a mapping, or a result with columns.

    Refused are a column of `needed` that is not there, and columns of different lengths.
    """
    import numpy as np

    arrays = {str(name): np.asarray(values) for name, values in _by_name(series).items()}
    lacking = [name for name in needed if name not in arrays]
    if lacking:
        made = [f"; `{MADE_BY[name]}` makes it" for name in lacking if name in MADE_BY][:1]
        raise Refusal(
            f"no column {', '.join(lacking)}{''.join(made)}; there are {', '.join(arrays)}"
        )
    sizes = {name: len(values) for name, values in arrays.items() if values.ndim}
    if len(set(sizes.values())) > 1:
        raise Refusal(f"columns of different lengths: {sizes}")
    return arrays


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
    given = {name: values[name] for name in kind._fields if name in values}
    # A blank in a DataFrame is NaN, in a sheet None.
    return kind(**{name: None if value != value else value for name, value in given.items()})


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
