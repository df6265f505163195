"""A file of any instrument in the Battery Data Format 1.3, with what was decided in sidecars."""

import gzip
import hashlib
import json
import re
from pathlib import Path

import numpy as np

from cellwright.refusal import Refusal
from first_look.one_file import look

ONTOLOGY = "https://w3id.org/battery-data-alliance/ontology/battery-data-format"
VERSION = "1.3.0"
# Column of the house → label and name of the quantity in the ontology. What was counted by us is
# no counter of the instrument: a reader would take it for a witness of the current.
QUANTITIES = {
    "test_time_second": ("Test Time / s", "test_time_second"),
    "current_ampere": ("Current / A", "current_ampere"),
    "voltage_volt": ("Voltage / V", "voltage_volt"),
    "unix_time_second": ("Unix Time / s", "unix_time_second"),
    "cycle_count": ("Cycle Count / 1", "cycle_count"),
    "step_index": ("Step ID", "step_id"),
    "step_count": ("Step Count / 1", "step_count"),
    "ambient_temperature_celsius": ("Ambient Temperature / degC", "ambient_temperature_celsius"),
    "surface_temperature_celsius": ("Temperature T1 / degC", "temperature_t1_celsius"),
    "net_capacity_ampere_hour": ("Net Capacity / Ah", "net_capacity_ah"),
    "frequency_hertz": ("Frequency / Hz", "frequency_hertz"),
    "impedance_real_ohm": ("Real Impedance / ohm", "real_impedance_ohm"),
    "impedance_imaginary_ohm": ("Imaginary Impedance / ohm", "imaginary_impedance_ohm"),
}
# Numbered channels: of thermometers the format knows five, of groups none, ours read back.
PROBE = re.compile(r"surface_temperature_([2-5])_celsius")
OF_GROUP = re.compile(r"(branch|cell)_(\d+)_(current|voltage|temperature)_\w+")
UNIT = {"current": "A", "voltage": "V", "temperature": "degC"}
MEDIA = {
    ".csv": "text/csv",
    ".csv.gz": "application/gzip",
    ".parquet": "application/vnd.apache.parquet",
    ".feather": "application/vnd.apache.arrow.file",
    ".arrow": "application/vnd.apache.arrow.file",
    ".json": "application/json",
}
KEY = b"cellwright"  # of what an artefact says of itself


def convert(path, to=None) -> tuple[Path, Path, Path]:
    """Write the cleaned series, or the spectrum, of a file as BDF, and its two sidecars.

    The current is positive on charge; rows that cleaning flags stay out, as in a campaign. A clean
    series of a campaign's results is a file like any other.

    Parameters
    ----------
    path : file of an instrument.
    to : path that ends as one of MEDIA; None: a csv beside the file.

    Returns
    -------
    Paths of the table, of `<name>.metadata.json` as the format's own package restores it, and of
    `<name>.jsonld`, a description of the data set for catalogues.

    Raises
    ------
    Refusal
        The file cannot be read, or a campaign would refuse it, or a goal is there already.
    """
    path = Path(path)
    goal = Path(to) if to else path.with_name(path.name.split(".")[0] + ".bdf.csv")
    kind = next((end for end in sorted(MEDIA, key=len)[::-1] if goal.name.endswith(end)), None)
    if kind is None:
        raise Refusal(f"{goal}: wanted a name that ends in {', '.join(MEDIA)}")
    stem = goal.name.removesuffix(kind)
    sidecars = [goal.with_name(f"{stem}{end}") for end in (".metadata.json", ".jsonld")]
    for one in (goal, *sidecars):
        if one.exists():
            raise Refusal(f"{one} is there already; it is not overwritten")
    seen = look(path)
    if seen.refused:
        raise Refusal(seen.refused)
    columns = seen.series or seen.reading.columns
    quantities = {name: found for name in columns if (found := quantity_of(name))}
    table = {label: columns[name] for name, (label, _) in quantities.items()}
    _write(goal, kind, table)
    about = _about(path, seen, quantities, len(next(iter(table.values()))))
    source = {"source": path.name}
    _write_json(sidecars[0], {"bdf": source, "extras": {"cellwright": about}})
    _write_json(sidecars[1], _dataset(goal, kind, about, quantities.values()))
    return goal, *sidecars


def quantity_of(name: str) -> tuple[str, str] | None:
    """Label of a column of the house, and its name in the ontology (blank: none of it)."""
    if probe := PROBE.fullmatch(name):
        return f"Temperature T{probe[1]} / degC", f"temperature_t{probe[1]}_celsius"
    if channel := OF_GROUP.fullmatch(name):
        owner, number, quantity = channel.groups()
        return f"{owner.title()} {number} {quantity.title()} / {UNIT[quantity]}", ""
    return QUANTITIES.get(name)


def _write(goal, kind, table):
    import pyarrow as pa
    from pyarrow import csv, feather, parquet

    table = pa.table(table)
    if kind == ".parquet":
        parquet.write_table(table, goal, compression="zstd")
    elif kind in (".feather", ".arrow"):
        feather.write_feather(table, goal)
    elif kind == ".json":
        columns = {name: table[name].to_pylist() for name in table.column_names}
        _write_json(goal, {name: list(map(_number, values)) for name, values in columns.items()})
    else:
        text = pa.BufferOutputStream()
        csv.write_csv(table, text, csv.WriteOptions(quoting_style="none"))
        data = text.getvalue().to_pybytes().replace(b'"', b"")
        # Without a date in it, the same table is the same file.
        goal.write_bytes(gzip.compress(data, mtime=0) if kind.endswith(".gz") else data)


def _number(value):
    """A number as JSON knows it, without NaN and infinity."""
    return value if isinstance(value, int) or np.isfinite(value) else None


def _about(path, seen, quantities, rows):
    """What was decided on the way from the file to the table."""
    from cellwright.formats.bdf import PARQUET

    reading, columns = seen.reading, seen.series or seen.reading.columns
    with path.open("rb") as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0)
        mark = file.read(len(PARQUET))
    about = {
        "source": path.name,
        "source_sha256": checksum,
        "instrument": reading.instrument,
        "rows": rows,
        "rows_in_source": len(next(iter(reading.columns.values()))),
        "current_is": "positive on charge" if seen.series else None,
        "notes": list(seen.notes),
        "left_out_columns": sorted(name for name in columns if name not in quantities),
        "not_in_the_ontology": sorted(label for label, term in quantities.values() if not term),
    }
    if "unix_time_second" in columns and reading.instrument != "bdf":
        about["unix_time_is"] = "the instrument's local time as it stands, its zone not known"
    if "surface_temperature_celsius" in columns:
        about["temperature_t1_is"] = "the thermometer on the cell, as far as the file says where"
    if mark == PARQUET:
        import pyarrow.parquet as pq

        said = (pq.read_schema(path).metadata or {}).get(KEY)
        about |= {"artefact": json.loads(said)} if said else {}
    return about


def _dataset(goal, kind, about, quantities):
    """The table as schema.org's Dataset, its columns by their terms of the ontology."""
    measured = [
        {
            "@type": "schema:PropertyValue",
            "schema:name": label,
            "schema:unitText": label.rpartition(" / ")[2] if " / " in label else "1",
        }
        | ({"schema:propertyID": f"{ONTOLOGY}#{term}"} if term else {})
        for label, term in quantities
    ]
    return {
        "@context": {"schema": "https://schema.org/", "dcterms": "http://purl.org/dc/terms/"},
        "@type": "schema:Dataset",
        "schema:name": goal.name.removesuffix(kind),
        "dcterms:conformsTo": f"{ONTOLOGY}/{VERSION}/battery-data-format",
        "schema:variableMeasured": measured,
        "schema:distribution": {
            "@type": "schema:DataDownload",
            "schema:contentUrl": goal.name,
            "schema:encodingFormat": MEDIA[kind],
            "schema:sha256": hashlib.sha256(goal.read_bytes()).hexdigest(),
        },
        "schema:isBasedOn": {
            "@type": "schema:CreativeWork",
            "schema:name": about["source"],
            "schema:sha256": about["source_sha256"],
        },
        "schema:description": "; ".join(about["notes"]),
    }


def _write_json(path, document):
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(f"{text}\n", encoding="utf-8")
