"""Arguments of the public interface as the science takes them: columns, rows, facts, settings."""

from collections.abc import Mapping

from cellwright.refusal import Refusal

NAMES = ("test_time_second", "current_ampere", "voltage_volt")
COUNTED = (*NAMES, "charge_ampere_hour")


def columns(series, *needed) -> dict:
    """Columns by name, (n,) arrays, of a DataFrame, a mapping, or a result with columns.

    Parameters
    ----------
    series : pandas DataFrame, mapping of name → (n,), or result of another step.
    needed : names that must be among them.

    Raises
    ------
    Refusal : A column that is needed is not there, or columns are of different lengths.
    """
    import numpy as np

    arrays = {str(name): np.asarray(values) for name, values in _named(series).items()}
    lacking = [name for name in needed if name not in arrays]
    if lacking:
        hint = "; `clean` adds it" if lacking == ["charge_ampere_hour"] else ""
        raise Refusal(f"no column {', '.join(lacking)}{hint}; there are {', '.join(arrays)}")
    sizes = {name: len(values) for name, values in arrays.items() if values.ndim}
    if len(set(sizes.values())) > 1:
        raise Refusal(f"columns of different lengths: {sizes}")
    return arrays


def _named(series):
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


def steps(table):
    """Steps of a record from the result of `segment`, a DataFrame or a mapping of its columns."""
    from cellwright.series.steps import Steps

    table = getattr(table, "rows", table)
    return table if isinstance(table, Steps) else Steps(**columns(table, *Steps._fields))


def repeats(table):
    """Repeats of the tests of a cell from the result of `repeats`, or its columns; None: none."""
    from cellwright.records.repeats import Repeats

    table = getattr(table, "rows", table)
    if table is None or isinstance(table, Repeats):
        return table
    return Repeats(**columns(table, *Repeats._fields))


def elsewhere(table, test, cut):
    """Name of the test in which each step of a test counts, see `repeats.steps_elsewhere`."""
    from cellwright.records.repeats import steps_elsewhere

    found = repeats(table)
    return None if found is None else steps_elsewhere(found, test_facts(test).test, steps(cut))


def rows(table) -> list[dict]:
    """Rows as dicts of plain values: of a list of rows, a result, a DataFrame or columns."""
    if isinstance(table, list | tuple) and not hasattr(table, "_asdict"):
        return [row._asdict() if hasattr(row, "_asdict") else row for row in table]
    inner = getattr(table, "rows", None)
    if inner is not None:
        return rows(inner)
    plain = {name: values.tolist() for name, values in columns(table).items()}
    return [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]


def cell_facts(cell):
    """CellFacts as they are, or from a mapping with more or fewer keys."""
    from cellwright.records.facts import CellFacts

    return _facts(CellFacts, cell)


def test_facts(test):
    """TestFacts as they are, or from a mapping with more or fewer keys."""
    from cellwright.records.facts import TestFacts

    return _facts(TestFacts, {"test": "", **test} if isinstance(test, Mapping) else test)


def branch_facts(branch):
    """BranchFacts as they are, or from a row of groups.tsv."""
    from cellwright.records.facts import BranchFacts

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


def tests(pairs) -> list:
    """MeasuredTest of pairs (TestFacts or mapping, series)."""
    from cellwright.records.facts import MeasuredTest

    return [MeasuredTest(test_facts(facts), columns(series, *COUNTED)) for facts, series in pairs]


MODEL = ("cell", "capacity_ampere_hour", "ocv", "members", "chosen")
BASIS = ("capacity_ampere_hour", "ocv")


def content(document):
    """The plain document of a result, or of the file of a path; a mapping or None as it is.

    Raises
    ------
    Refusal : as `json_of_file`.
    """
    held = getattr(document, "content", None)
    held = document if held is None else held
    return json_of_file(held) if _is_path(held) else held


def model(document, *, cell=None):
    """Content of a model: of a result, a document, or the path of results/models/<cell>.json.

    Parameters
    ----------
    document : result of `identify` or `finish_model`, its content, or a path.
    cell : name, whose model is taken where the document holds the models of a group.

    Raises
    ------
    Refusal : as `json_of_file`; something else than a model, with what it is.
    """
    from cellwright.circuits.model_file import model_of

    held = content(document)
    if cell is not None and isinstance(held, Mapping):
        held = model_of(held, cell)
    wanted = "a model: a result of `identify` or `finish_model`, or its results/models/<cell>.json"
    return _of_fields(document, held, MODEL, wanted)


def models(documents) -> list:
    """Content of each of several models, see `model`.

    Raises
    ------
    Refusal : one document instead of several, or as `model`.
    """
    if _is_path(documents) or isinstance(getattr(documents, "content", documents), Mapping):
        raise Refusal(f"found {_named_document(documents)}, wanted a list of models, one a cell")
    return [model(document) for document in documents]


def basis(document):
    """Content of a basis: of a result, a document, a model, or path of results/basis/<cell>.json.

    Raises
    ------
    Refusal : as `json_of_file`; something else than a basis or model, with what it is.
    """
    wanted = "a result of `basis`, its results/basis/<cell>.json, or a model"
    return _of_fields(document, content(document), BASIS, wanted)


def _of_fields(document, held, fields, wanted):
    """`held`, refused where it has not these fields; `document` is what the user gave."""
    if isinstance(held, Mapping) and all(name in held for name in fields):
        return held
    place = f"{document}: " if _is_path(document) else ""
    raise Refusal(f"{place}found {_named_document(held)}, wanted {wanted}")


def _named_document(held):
    """What a document is, in words: its schema, else its first fields, else its type."""
    if not isinstance(held, Mapping):
        return "nothing" if held is None else f"a {type(held).__name__}"
    if "schema" in held:
        return f"a document of schema {held['schema']}"
    shown = list(map(str, held))
    more = f" and {len(shown) - SHOWN_FIELDS} more" if len(shown) > SHOWN_FIELDS else ""
    return f"a document of {', '.join(shown[:SHOWN_FIELDS]) or 'nothing'}{more}"


SHOWN_FIELDS = 5


def _is_path(given):
    return isinstance(given, str) or hasattr(given, "__fspath__")


def json_of_file(path):
    """Content of a JSON file that a user names, without the provenance of an artefact.

    Raises
    ------
    Refusal : No such file, or no JSON in it; of an artefact without content the reason that it
        carries.
    """
    import json

    try:
        with open(path, encoding="utf-8") as file:
            document = json.load(file)
    except (OSError, ValueError) as error:
        raise Refusal(f"{path}: {error}, wanted a JSON document") from error
    about = document.get("provenance") if isinstance(document, dict) else None
    if not isinstance(about, dict):
        return document
    if about.get("reason"):
        raise Refusal(f"{path} holds nothing: {about['reason']}")
    return {name: value for name, value in document.items() if name != "provenance"}


def entries(pairs, fields=None) -> list[dict]:
    """Rows of results as dicts, each with the name, temperature and cycle of its test.

    Parameters
    ----------
    pairs : (TestFacts or mapping, result) each; a dict is taken as it is.
    fields : function, result → list of dicts of plain values.
    """
    dated = []
    for pair in pairs:
        if isinstance(pair, Mapping):
            dated.append(pair)
            continue
        facts, result = test_facts(pair[0]), pair[1]
        names = ("test", "ambient_temperature_celsius", "cycle")
        dated += [
            {name: getattr(facts, name) for name in names} | row for row in (fields or rows)(result)
        ]
    return dated


def plain(values: dict) -> dict:
    """A dict with its arrays as lists."""
    import numpy as np

    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}


def settings_of(kind, settings, changes):
    """Settings of a step: the defaults or `settings`, with single keys changed.

    Parameters
    ----------
    kind : class of `cellwright.settings`.
    settings : None, a value of `kind`, or a mapping that names each of its keys.
    changes : dict of single keys.

    Raises
    ------
    Refusal
        An unknown key, or a mapping that lacks one: a campaign's choice must not be replaced by a
        default unnoticed.
    """
    if isinstance(settings, Mapping):
        lacking = [name for name in kind._fields if name not in settings]
        if lacking:
            raise Refusal(f"settings {kind.__name__} lack {', '.join(lacking)}")
        settings = _changed(kind, kind(), settings)
    if settings is not None and not isinstance(settings, kind):
        raise Refusal(f"settings are {type(settings).__name__}, wanted {kind.__name__}")
    return _changed(kind, settings or kind(), changes)


def _changed(kind, value, changes):
    unknown = [name for name in changes if name not in kind._fields]
    if unknown:
        known = ", ".join(kind._fields)
        raise Refusal(f"{kind.__name__} has no setting {', '.join(unknown)}; it has {known}")
    return value._replace(**{k: _typed(getattr(value, k), v) for k, v in changes.items()})


def _typed(before, value):
    """A value as the settings hold it: a list as tuple, a mapping as the section it replaces."""
    if hasattr(before, "_fields") and isinstance(value, Mapping):
        return settings_of(type(before), value, {})
    return tuple(value) if isinstance(value, list) else value
