"""Binary files by libraries: Arbin's data bases (access-parser), Neware's nda and ndax (fastnda).

Both give what is left of a cut file as if it were all: whether it is whole is checked here.
"""

import logging
import re
import tempfile
import warnings
import zipfile
from pathlib import Path

import numpy as np

from cellwright.formats.arbin import SPELT, meaning
from cellwright.formats.fields import (
    COUNTERS,
    ENERGIES,
    SERIES,
    converted,
    in_house_unit,
    known_fields,
    probe_column,
    require,
)
from cellwright.formats.jet import MARKS, Base
from cellwright.formats.table import unread
from cellwright.formats.workbook import DAY_SECOND, EXCEL_EPOCH_DAY
from cellwright.refusal import Refusal

# How fastnda fails at a file that it cannot read, beside what polars raises.
FAULTS = (ArithmeticError, LookupError, OSError, TypeError, ValueError, RuntimeError, EOFError)
FAULTS = (*FAULTS, AssertionError, SyntaxError, zipfile.BadZipFile)
NEWARE = b"NEWARE"
# Of an nda: version from which lengths have eight bytes, and places of (first byte, length) of its
# parts (the test's own words, the readings, others), before that version and from it on.
WIDE = 129
PARTS, WIDE_PARTS, READINGS = (24, 64, 72), (34, 82), 1
LINK = 242  # of a wide header, the part behind which the next header stands
HEADER, LONGEST_READING = 1024, 256  # bytes of a wide header; a reading has 52 to 88
TEMPERATURE = 1  # type of an auxiliary input of Arbin


class ArbinDatabase:
    """Arbin's .res: a Jet data base, its readings in Channel_Normal_Table."""

    NAME = "arbin_res"

    @staticmethod
    def recognises(head: bytes) -> bool:
        """A Jet or ACE data base."""
        return head.startswith(MARKS)

    @staticmethod
    def read(data: bytes) -> tuple[dict[str, np.ndarray], list[str]]:
        """Columns of the one channel of the file in the order of its data points, and notes.

        Raises
        ------
        Refusal
            The file is cut off or damaged, holds no such table, or several tests.
        """
        base = Base(data)
        found = base.numbers("Channel_Normal_Table")
        fields = known_fields(found, meaning)
        require(fields, SERIES, SPELT)
        tests = np.unique(found["Test_ID"])
        if len(tests) > 1:
            raise Refusal(f"the data base holds {len(tests)} tests; one test a file is wanted")
        columns = converted(found, fields)
        columns["unix_time_second"] = (found["DateTime"] - EXCEL_EPOCH_DAY) * DAY_SECOND
        probes, notes = _thermometers(base, found["Data_Point"])
        used = [*(field.label for field in fields), "Test_ID", "Data_Point", "DateTime"]
        notes += unread([x for x in found if np.nanmax(np.abs(found[x]), initial=0) > 0], used)
        # A data base has no order of rows: they come as they lie on its pages.
        order = np.argsort(found["Data_Point"], kind="stable")
        return {name: values[order] for name, values in (columns | probes).items()}, notes


def _thermometers(base, points):
    """Auxiliary temperatures [degC] at each data point, NaN where there is none, and notes."""
    found = base.numbers("Auxiliary_Table") if "Auxiliary_Table" in base.base.catalog else {}
    if not found or not len(found["X"]):
        return {}, []
    listed = base.texts("Aux_Global_Data_Table")
    keys = zip(*(listed.get(x, []) for x in ("Data_Type", "Auxiliary_Index")), strict=True)
    units = dict(zip(keys, listed.get("Unit", []), strict=True))
    columns, others = {}, []
    inputs = np.unique(np.column_stack([found["Data_Type"], found["Auxiliary_Index"]]), axis=0)
    for kind, number in inputs.astype(int).tolist():
        if kind != TEMPERATURE:
            others.append(f"{number} of type {kind}")
            continue
        rows = (found["Data_Type"] == kind) & (found["Auxiliary_Index"] == number)
        label, unit = f"auxiliary input {number}", (units.get((kind, number)) or "C").strip()
        read = in_house_unit(found["X"][rows], quantity="temperature", unit=unit, label=label)
        columns[probe_column(len(columns) + 1)] = _at(points, found["Data_Point"][rows], read)
    notes = [f"auxiliary inputs that are not read: {', '.join(others)}"] if others else []
    return columns, notes


def _at(points, known, values):
    """Values of known data points at all points, NaN at those that are not known."""
    order = np.argsort(known, kind="stable")
    place = np.minimum(np.searchsorted(known[order], points), len(known) - 1)
    return np.where(known[order][place] == points, values[order][place], np.nan)


class NewareBinary:
    """Neware's .nda and .ndax, by fastnda (BSD licence)."""

    NAME = "neware_binary"

    @staticmethod
    def recognises(head: bytes) -> bool:
        """A NEWARE mark, or a zip archive of .ndc files."""
        archive = head.startswith(b"PK\x03\x04")
        return head.startswith(NEWARE) or (archive and (b".ndc" in head or b"VersionInfo" in head))

    @staticmethod
    def read(data: bytes) -> tuple[dict[str, np.ndarray], list[str]]:
        """Columns of the file, and notes.

        Raises
        ------
        Refusal
            The file is cut off, damaged, or of a version that is not known; readings are missing.
        """
        # An archive that is cut off has lost its list of parts, and has not come this far.
        wide = not data.startswith(NEWARE)
        notes = [] if wide else _length_noted(data)
        frame, more = _of_neware(data, ".ndax" if wide else ".nda")
        _refuse_gaps(frame)
        columns, probes = _columns_of_neware(frame), _probes_of_neware(frame)
        lost = len(set(re.findall(rb"data(?:_AUX(?:_\d+)*)?_\d+\.ndc", data))) if wide else 0
        if lost and not any(name.startswith("aux") for name in frame.columns):
            more.append(f"{lost} auxiliary channel(s) of the archive could not be read: left out")
        return columns | probes, [*notes, *more]


def _length_noted(data):
    """Refuse an nda that ends before a part that its header tells of; notes."""
    parts = _parts_of(data)
    end = max(map(sum, parts))
    if end > len(data):
        raise Refusal(
            f"the nda file is cut off: its header tells of {end} bytes, it has {len(data)}"
        )
    if not parts[READINGS][1]:
        return ["the header of the nda file does not say its length: its end may be missing"]
    return []


def _parts_of(data):
    """First byte and length of each part that the header of an nda tells of."""
    wide = len(data) > 14 and data[14] >= WIDE
    size = 8 if wide else 4

    def part(at):
        return tuple(int.from_bytes(data[k : k + size], "little") for k in (at, at + size))

    parts = [part(at) for at in (WIDE_PARTS if wide else PARTS)]
    head = HEADER  # from where on, if the first header names no first byte, others stand
    while wide and parts[READINGS][0] == 0 and data.startswith(NEWARE, head):
        parts += [part(head + WIDE_PARTS[READINGS]), part(head + LINK)]
        if sum(parts[-1]) <= head:
            break
        head = sum(parts[-1])
    return parts


def _of_neware(data, suffix):
    """The frame of fastnda, and what it warns of as notes."""
    import zlib

    own = zlib.decompress, zlib.decompressobj
    try:
        import fastnda.ndax  # puts functions of another library in place of these, for all
    finally:
        zlib.decompress, zlib.decompressobj = own
    import fastnda.utils
    from polars.exceptions import PanicException, PolarsError

    logging.getLogger("fastnda").setLevel(logging.CRITICAL)  # notes and refusals say it
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        path = Path(folder) / f"file{suffix}"
        path.write_bytes(data)
        try:
            frame = fastnda.read(path, cycle_mode="raw")
            counted = fastnda.read_metadata(path).get("num_datapoints")
        except (*FAULTS, PolarsError, PanicException) as fault:
            raise Refusal(f"fastnda cannot read the Neware file: {fault}") from None
    if suffix == ".nda" and data[14] >= WIDE:
        _refuse_fewer(frame.height, _parts_of(data)[READINGS][1], counted)
    unsure = [w for w in said if issubclass(w.category, fastnda.utils.UnverifiedFormatWarning)]
    told = dict.fromkeys(str(warning.message).split(" - ")[0] for warning in unsure)
    return frame, [f"fastnda, which reads the file, says: {text}" for text in told]


def _refuse_fewer(there, size, counted):
    """Refuse fewer readings than a wide header's count, or its number of bytes, tells of.

    size : of all readings [byte]; counted : their number, or what stands in its place.
    """
    if counted and size % counted == 0 and there != counted:
        raise Refusal(f"readings of the nda file are missing: it counts {counted}, has {there}")
    if size and there and (size % there or size > LONGEST_READING * there):
        raise Refusal(
            f"readings of the nda file are missing: {there} are no {size} bytes, as its header says"
        )


def _refuse_gaps(frame):
    """Refuse a file whose readings, which are numbered from 1 on, are not all there."""
    if not frame.height:
        raise Refusal("the Neware file holds no reading")
    missing = {"index", "total_time_s", "current_mA", "voltage_V", "step_count"}
    if missing := missing - set(frame.columns):
        raise Refusal(
            f"the Neware file is damaged: {', '.join(sorted(missing))} of its readings is missing"
        )
    numbers = frame["index"].to_numpy()
    wrong = np.flatnonzero(numbers != np.arange(1, frame.height + 1))
    if len(wrong):
        row = int(wrong[0])
        raise Refusal(
            f"readings of the Neware file are missing: row {row + 1} of data is its reading "
            f"{numbers[row]}; export the test anew"
        )
    for name in ("total_time_s", "current_mA", "voltage_V"):
        if blank := frame[name].null_count():
            raise Refusal(f"the Neware file is damaged: {name} is missing in {blank} readings")


def _columns_of_neware(frame):
    """Columns of the house from the frame of fastnda."""
    values = {
        name: frame[name].to_numpy().astype(float)
        for name in frame.columns
        if frame[name].dtype.is_numeric()
    }
    columns = {
        "test_time_second": values["total_time_s"],
        "current_ampere": values["current_mA"] / 1000,
        "voltage_volt": values["voltage_V"],
        "step_count": values["step_count"].astype(np.int64),
    }
    for name in ("step_index", "cycle_count"):
        if name in values and np.isfinite(values[name]).all():
            columns[name] = values[name].astype(np.int64)
    if "unix_time_s" in values:
        columns["unix_time_second"] = values["unix_time_s"]
    first = np.diff(columns["step_count"], prepend=-1) != 0
    for name, counters in (("capacity_mAh", COUNTERS), ("energy_mWh", ENERGIES)):
        if name in values:  # net, and counted anew in each step
            moved = np.where(first, values[name], np.diff(values[name], prepend=0.0)) / 1000
            for counter, sign in zip(counters, (1, -1), strict=True):
                columns[counter] = np.cumsum(np.maximum(sign * moved, 0.0))
    return columns


def _probes_of_neware(frame):
    """Auxiliary temperatures [degC] by name: the first one, and others by number."""
    probes = [name for name in frame.columns if name.endswith("temperature_degC")]
    return {
        probe_column(k): frame[name].to_numpy().astype(float) for k, name in enumerate(probes, 1)
    }
