"""Battery Data Format 1.3: csv, Parquet, Arrow or JSON, labels `Quantity / unit` or names.

Sources: Battery Data Alliance, Battery Data Format, ontology 1.3.0 of July 2026 (terms, units and
alternative names); the campaign contract (channels of groups).
"""

import re
from contextlib import contextmanager

import numpy as np

from cellwright import gate
from cellwright.formats.arrow_size import unpacked_byte
from cellwright.formats.content import Content, head_of, whole_of
from cellwright.formats.dates import Clocks
from cellwright.formats.fields import (
    COUNTERS,
    IMPEDANCE,
    SERIES,
    UNITS,
    WORDS,
    Field,
    converted,
    known_fields,
    label_of,
    refuse_repeated,
    require,
)
from cellwright.formats.second_clock import BESIDE, refuse_contradicting
from cellwright.formats.table import is_written, layout_of, line_of, read_table, unread
from cellwright.refusal import Refusal

NAME = "bdf"
SIMULATED = "Simulated Voltage / V"
DOUBLE_BYTE = 8
EXAMPLE_ROWS = 100
PARQUET, ARROW, JSON = b"PAR1", b"ARROW1", (b"{", b"[")
JSON_BEGIN = re.compile(rb'\s*(?:\{\s*"|\[\s*\{)')
SURFACE = "surface_temperature_celsius"
# Quantities that the house uses. Of several that say the same thing, as the format means it, the
# first one of this list is read, and the others are named as not read.
MEANING = {
    "test time": ("test_time_second", "time"),
    "current": ("current_ampere", "current"),
    "voltage": ("voltage_volt", "voltage"),
    "unix time": ("unix_time_second", "time"),
    "date time": ("unix_time_second", "time"),  # its name until 2025
    "ambient temperature": ("ambient_temperature_celsius", "temperature"),
    "surface temperature": (SURFACE, "temperature"),
    "temperature t1": (SURFACE, "temperature"),
    "net capacity": ("net_capacity_ampere_hour", "charge"),
    # Counters of a test never begin anew; those of a schedule, cycle or step do, which is seen.
    "charging capacity": ("charge_counter", "charge"),
    "discharging capacity": ("discharge_counter", "charge"),
    "schedule charging capacity": ("charge_counter", "charge"),
    "schedule discharging capacity": ("discharge_counter", "charge"),
    "cycle charging capacity": ("charge_counter", "charge"),
    "cycle discharging capacity": ("discharge_counter", "charge"),
    "step charging capacity": ("charge_counter", "charge"),
    "step discharging capacity": ("discharge_counter", "charge"),
    "charging energy": ("charge_energy_counter", "energy"),
    "discharging energy": ("discharge_energy_counter", "energy"),
    "step id": ("step_index", "count"),
    "step index": ("step_index", "count"),
    "step count": ("step_count", "count"),
    "cycle count": ("cycle_count", "count"),
    "cycle": ("cycle_count", "count"),  # `cycle_dimensionless`, until 2025
    "frequency": ("frequency_hertz", "frequency"),
    "real impedance": ("impedance_real_ohm", "impedance"),
    "imaginary impedance": ("impedance_imaginary_ohm", "impedance"),
}
OTHER_NAMES = {  # that the ontology gives beside the names themselves
    "cycle charge capacity": "cycle charging capacity",
    "cycle discharge capacity": "cycle discharging capacity",
    "step charge capacity": "step charging capacity",
    "step discharge capacity": "step discharging capacity",
}
SPELT = {
    "test_time_second": "Test Time / s",
    "current_ampere": "Current / A",
    "voltage_volt": "Voltage / V",
    "frequency_hertz": "Frequency / Hz",
    "impedance_real_ohm": "Real Impedance / ohm",
    "impedance_imaginary_ohm": "Imaginary Impedance / ohm",
}
# Numbered channels of a group: of its members and of its cells, with the house's units.
OF_GROUP = {
    "branch": {"current": "ampere"},
    "cell": {"voltage": "volt", "temperature": "celsius"},
}
SPOKEN_UNIT = re.compile(rf"^(?P<base>.+)_(?P<word>{'|'.join(sorted(WORDS, key=len)[::-1])})$")
# Units of the short names, such as test_time_s and current_A.
SHORT = {"s": "s", "ms": "ms", "min": "min", "h": "h", "a": "A", "ma": "mA", "v": "V", "mv": "mV"}
SHORT |= {"ah": "Ah", "mah": "mAh", "degc": "degC", "c": "degC", "k": "K", "1": "1"}
SHORT_UNIT = re.compile(rf"^(?P<base>.+)_(?P<word>{'|'.join(SHORT)})$", re.I)
BARE = ("step id", "step index", "step count", "cycle count")  # counts, which need no unit
TICKS = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}  # of a timestamp, in a second
COUNTS = ("cycle_count", "step_count", "step_index")
KEY = re.compile(rb'"((?:[^"\\]|\\.)*)"\s*:')
# A step of program lasts some rows; a counter of rows grows from each row to the next.
MOSTLY = 0.5


def recognises(head: bytes) -> bool:
    """A Parquet or Arrow file, or one of the format's own labels in a first line or as a key.

    A short name is one only where the time is one too: others write `current_A`.
    """
    if head.startswith((PARQUET, ARROW)):
        return True
    if head.lstrip().startswith(JSON):
        labels = [key.decode("utf-8", "replace") for key in KEY.findall(head)]
    else:
        labels = [label.strip().strip('"') for label in re.split(r"[,;\t]", line_of(head, 1))]
    own = [field.column for field in map(_meaning, labels) if field and not _is_short(field)]
    short = [field.column for field in map(_meaning, labels) if field]
    return any(column in SPELT for column in own) or "test_time_second" in short


def makes_table(labels) -> bool:
    """Whether labels of the format, in any spelling, name all that a series or a spectrum needs."""
    named = {field.column for field in map(_meaning, labels) if field}
    return named.issuperset(SERIES) or named.issuperset(IMPEDANCE)


def read(data: bytes | Content) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Columns of a BDF file, a spectrum where it has a frequency, else a series; and notes.

    Raises
    ------
    Refusal
        A column that is missing or said twice, text where a number belongs, a damaged file.
    """
    columns, notes, fields = _read(data, _meaning, _checked)
    step = next((field.label for field in fields if field.column == "step_index"), "")
    if "step_index" in columns and _is_record_counter(columns["step_index"], step):
        del columns["step_index"]
        notes.append(f"{step!r} counts the rows of a step: it is no step number")
    for name in [name for name in COUNTS if columns.get(name, np.zeros(1, int)).dtype.kind != "i"]:
        # Such as 2π, of software that takes the unit of a count for that of an angle.
        notes.append(f"{name} is left out: {columns.pop(name)[0]:.6g} is no count")
    return columns, tuple(notes)


def _is_record_counter(counter, label):
    """Whether `Step Index` is what its name means in version 1.3, a counter of rows.

    Files from before, and those of campaigns, call the number of a step so.
    """
    named = _base_and_unit(label)[0] == "step index"
    return named and len(counter) > 1 and np.mean(np.diff(counter) == 1) > MOSTLY


def read_simulated(data: bytes | Content) -> dict[str, np.ndarray]:
    """Test time [s] and simulated voltage [V] of a BDF file: test_time_second, voltage_volt.

    The voltage is that of `Simulated Voltage / V`; `Voltage / V` in a file that has no current, and
    so is a simulator's own.
    """
    return _read(data, _simulated_meaning, _checked_simulated)[0]


def _read(data, meaning, checked):
    """Columns of a file, notes, and their fields: `meaning` knows labels, `checked` the set."""
    head = head_of(data)
    if head.startswith((PARQUET, ARROW)) or head.lstrip().startswith(JSON):
        labels, numbers = _columns_of(whole_of(data))
        fields = checked(_preferred(labels, meaning))
        return converted(numbers(fields), fields), unread(labels, [f.label for f in fields]), fields
    layout = layout_of(data)
    fields = checked(_preferred(layout.labels, meaning))
    labels = [field.label for field in fields]
    clock = next((f.label for f in fields if f.column == "test_time_second"), None)
    if clock and is_written(data, layout, clock):  # as 0d 00:10:00.5
        others = [label for label in labels if label != clock]
        found, notes = read_table(data, layout, others, texts={clock: Clocks})
        return converted(found, fields), [*notes], fields
    found, notes = read_table(data, layout, labels)
    columns = converted(found, fields)
    if clock:
        refuse_contradicting(clock, columns["test_time_second"], _other_clocks(data, layout))
    return columns, [*notes], fields


def _other_clocks(data, layout):
    """Seconds (n,) of columns that count a time as other software calls the test's, by label."""
    named = {label: _base_and_unit(label) for label in dict.fromkeys(layout.labels)}
    units = {
        label: UNITS["time"][unit]
        for label, (base, unit) in named.items()
        if base in BESIDE and unit in UNITS["time"] and not is_written(data, layout, label)
    }
    found = read_table(data, layout, list(units)).columns if units else {}
    return {label: np.asarray(found[label]) * unit for label, unit in units.items()}


def _preferred(labels, meaning):
    """Known fields, one for each column of the house: of several quantities the preferred one."""
    refuse_repeated(list(labels), meaning)
    ranks = {base: rank for rank, base in enumerate(MEANING)}
    best = {}
    surface = any(_base_and_unit(label)[0] == "surface temperature" for label in labels)
    for label in dict.fromkeys(labels):
        field = meaning(label)
        if field is None:
            continue
        if surface and _base_and_unit(label)[0] == "temperature t1":
            field = field._replace(column="surface_temperature_1_celsius")
        rank = ranks.get(_base_and_unit(label)[0], -1)
        first = best.setdefault(field.column, (rank, []))
        if rank < first[0]:
            best[field.column] = (rank, [field])
        elif rank == first[0]:
            first[1].append(field)
    _one_scope(best)
    kept = {field.label: field for _, fields in best.values() for field in fields}
    return known_fields(kept, kept.get)


def _one_scope(best):
    """Charge and discharge are counted from the same moments on, or neither is read."""
    ranks = [best[name][0] for name in COUNTERS if name in best]
    # Of one scope they stand side by side in MEANING.
    if len(ranks) == 1 or (ranks and np.ptp(ranks) > 1):
        for name in COUNTERS:
            best.pop(name, None)


def _simulated_meaning(label: str) -> Field | None:
    base, unit = _base_and_unit(label)
    simulated = Field(label, "simulated_voltage_volt", "voltage", unit)
    return simulated if base == "simulated voltage" else _meaning(label)


def _checked_simulated(fields: list[Field]) -> list[Field]:
    """The two fields of a simulation."""
    by_column = {field.column: field for field in fields}
    voltage = by_column.get("simulated_voltage_volt")
    if voltage is None and "current_ampere" not in by_column:
        voltage = by_column.get("voltage_volt")
    kept = [by_column[name] for name in ("test_time_second",) if name in by_column]
    kept += [voltage._replace(column="voltage_volt")] if voltage else []
    spelt = SPELT | {"voltage_volt": SIMULATED}
    require(kept, ("test_time_second", "voltage_volt"), spelt)
    return kept


def refuse_large(data: bytes, largest_megabyte: float | None = None) -> None:
    """Refuse a Parquet or Arrow file whose known columns take more memory than they may.

    Its pages may be repetitions of one value: neither the file nor they are long.
    """
    if data.startswith(ARROW):
        with refused_at("Arrow"):
            names = _arrow_file(data).schema.names
            held = unpacked_byte(data, sum(map(bool, map(_simulated_meaning, names))))
        gate.refuse_columns(len(names))
        gate.refuse_unpacked(held, len(data), largest_megabyte)
        return
    about = opened(data)
    gate.refuse_columns(len(about.schema_arrow.names))
    known = [name for name in about.schema_arrow.names if _simulated_meaning(name)]
    groups = [about.metadata.row_group(k) for k in range(about.metadata.num_row_groups)]
    held = max(
        about.metadata.num_rows * DOUBLE_BYTE * len(known),
        sum(group.total_byte_size for group in groups),
    )
    gate.refuse_unpacked(held, len(data), largest_megabyte)


def _columns_of(data: bytes):
    """Labels of a Parquet, Arrow or JSON file, and a function, fields → numbers by label."""
    if data.startswith(PARQUET):
        return _of_parquet(data)
    return _of_arrow(data) if data.startswith(ARROW) else _of_json(data)


def opened(data: bytes):
    """A Parquet file of pyarrow's, refused where it is damaged."""
    import pyarrow as pa
    from pyarrow import parquet

    with refused_at("Parquet"):
        return parquet.ParquetFile(pa.BufferReader(data))


def _of_parquet(data):
    import pyarrow as pa

    file = opened(data)

    def numbers(fields):
        for field in fields:  # before they are read: texts may be of any length
            kind = file.schema_arrow.field(field.label).type
            if not (_is_number(kind) or (pa.types.is_timestamp(kind) and field.quantity == "time")):
                raise Refusal(f"column {field.label!r} holds {kind}{_example(file, field.label)}")
        with refused_at("Parquet"):
            found = file.read([field.label for field in fields])
        return {field.label: _numbers(field, found[field.label]) for field in fields}

    return file.schema_arrow.names, numbers


def _is_number(kind):
    import pyarrow as pa

    return pa.types.is_integer(kind) or pa.types.is_floating(kind)


def _example(file, label):
    """A value of a column that holds no numbers, in words, from its first rows."""
    first = next(file.iter_batches(EXAMPLE_ROWS, columns=[label]), None)
    values = [] if first is None else first.column(0).to_pylist()
    example = next((f", such as {str(value)[:40]!r}" for value in values if value is not None), "")
    return f"{example}; numbers are wanted"


def _arrow_file(data):
    import pyarrow as pa

    return pa.ipc.open_file(pa.BufferReader(data))


def _of_arrow(data):
    with refused_at("Arrow"):
        table = _arrow_file(data).read_all()
        # A damaged file may promise more numbers than it holds.
        table.validate(full=True)
        labels = table.column_names
    return labels, lambda fields: {
        field.label: _numbers(field, table[field.label]) for field in fields
    }


@contextmanager
def refused_at(kind):
    """Refuse a file of a kind at which pyarrow fails; its names may be no text any more."""
    import pyarrow as pa

    try:
        yield
    except (MemoryError, Refusal):  # of the machine; what a file claims is known before
        raise
    except (pa.ArrowException, OSError, ValueError) as fault:
        raise Refusal(f"the {kind} file is cut off or damaged: {fault}") from None


def _numbers(field: Field, column) -> np.ndarray:
    """One column of Parquet or Arrow [its unit] as float64, missing values NaN."""
    import pyarrow as pa

    if _is_number(column.type):
        return column.cast(pa.float64(), safe=False).to_numpy().astype(float)
    if pa.types.is_timestamp(column.type) and field.quantity == "time":
        # In their own unit: nanoseconds end with the year 2262.
        ticks = column.cast(pa.int64()).to_numpy() / TICKS[column.type.unit]
        return ticks / UNITS["time"][field.unit]
    example = next((value for value in column.to_pylist() if value is not None), None)
    raise Refusal(
        f"column {field.label!r} holds {column.type}, such as {example!r}; numbers are wanted"
    )


def _of_json(data):
    """Columns of a document: an object of lists, a list of rows, or a row a line."""
    columns = _columns_of_json(_document(data))
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise Refusal(f"columns of the JSON document have different lengths: {sorted(lengths)}")
    return list(columns), lambda fields: {
        field.label: _numbers_of_json(field.label, columns[field.label]) for field in fields
    }


def _document(data):
    import json

    try:
        text = data.decode("utf-8-sig")
        try:
            return json.loads(text, object_pairs_hook=_object)
        except json.JSONDecodeError as fault:
            if not fault.msg.startswith("Extra data"):
                raise
            lines = filter(str.strip, text.splitlines())
            return [json.loads(line, object_pairs_hook=_object) for line in lines]
    except Refusal:
        raise
    except (ValueError, RecursionError) as fault:
        raise Refusal(f"the JSON document is cut off or damaged: {fault}") from None


def _object(pairs):
    """An object of a document, each key once, of letters that can be written."""
    # Half of a letter, as \ud800 is one, is in no text that anything can hold.
    named = {key.encode("utf-8", "replace").decode(): value for key, value in pairs}
    if len(named) < len(pairs):
        twice = next(key for key, _ in pairs if sum(key == other for other, _ in pairs) > 1)
        raise Refusal(f"the JSON document has the key {twice!r} twice in one object; one is wanted")
    return named


def _columns_of_json(document):
    rows = isinstance(document, list) and document
    if rows and all(isinstance(row, dict) for row in document):
        labels = dict.fromkeys(label for row in document for label in row)
        return {label: [row.get(label) for row in document] for label in labels}
    if isinstance(document, dict) and all(isinstance(v, list) for v in document.values()):
        return document
    raise Refusal("the JSON document is no table: a list of rows, or an object of lists, is wanted")


def _numbers_of_json(label, values):
    wrong = next((k for k, v in enumerate(values) if not _is_json_number(v)), None)
    if wrong is not None:
        found = f"found {repr(values[wrong])[:40]}, a number is wanted"
        raise Refusal(f"row {wrong + 1} of data: column {label!r}: {found}")
    return np.array([np.nan if value is None else value for value in values], float)


def _is_json_number(value):
    if isinstance(value, bool) or not isinstance(value, int | float | None):
        return False
    try:
        return value is None or isinstance(float(value), float)
    except OverflowError:  # hundreds of digits
        return False


def _checked(fields: list[Field]) -> list[Field]:
    spectrum = any(field.column == "frequency_hertz" for field in fields)
    require(fields, IMPEDANCE if spectrum else SERIES, SPELT)
    return fields


def _meaning(label: str) -> Field | None:
    base, unit = _base_and_unit(label)
    numbered = re.fullmatch(r"(branch|cell) (\d{1,4}) (current|voltage|temperature)", base)
    if numbered and numbered[3] in OF_GROUP[numbered[1]]:
        owner, number, quantity = numbered.groups()
        column = f"{owner}_{int(number)}_{quantity}_{OF_GROUP[owner][quantity]}"
        return Field(label, column, quantity, unit)
    probe = re.fullmatch(r"temperature t(\d{1,4})", base)
    if probe and probe[1] != "1":
        return Field(label, f"surface_temperature_{probe[1]}_celsius", "temperature", unit)
    return Field(label, *MEANING[base], unit) if base in MEANING else None


def _base_and_unit(label: str) -> tuple[str, str]:
    """Quantity, as the ontology calls it, and unit of a label in any of its spellings."""
    label = label_of(label)
    base, slash, unit = label.rpartition(" / ")
    if slash:
        base, unit = base.strip().lower(), unit.strip()
    else:
        spoken, short = SPOKEN_UNIT.match(label), SHORT_UNIT.match(label)
        base, unit = label.replace("_", " ").strip().lower(), ""
        if spoken:
            base, unit = spoken["base"].replace("_", " ").lower(), WORDS[spoken["word"]]
        elif short and base not in BARE:
            base, unit = short["base"].replace("_", " ").lower(), SHORT[short["word"].lower()]
        elif base not in BARE:
            return "", ""
    # T1 was called a surface temperature until version 1.3, which does not say where it lies.
    base = re.sub(r"^surface (?=temperature t\d)", "", base)
    return OTHER_NAMES.get(base, base), unit


def _is_short(field):
    """Whether a field's label is a short name, or has no unit at all."""
    return " / " not in field.label and not SPOKEN_UNIT.match(field.label)
