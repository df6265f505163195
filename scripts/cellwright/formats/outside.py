"""Binary files that others' programs read: Arbin's data bases (mdb-export), Neware's nda and ndax.

Both are optional. Where one is missing the file is refused with what to install.
"""

import importlib.util
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from cellwright.formats.arbin import SPELT, meaning
from cellwright.formats.fields import SERIES, converted, known_fields, require
from cellwright.formats.table import layout_of, read_table
from cellwright.formats.workbook import DAY_SECOND, EXCEL_EPOCH_DAY
from cellwright.refusal import Refusal

JET = (b"\x00\x01\x00\x00Standard Jet DB", b"\x00\x01\x00\x00Standard ACE DB")
# How the library says that it cannot read a file.
FAULTS = (ArithmeticError, LookupError, OSError, TypeError, ValueError, RuntimeError, EOFError)
SLOWEST = 600.0  # s, after which a program that reads a file is stopped


class ArbinDatabase:
    """Arbin's .res: a Jet data base, its readings in Channel_Normal_Table."""

    NAME = "arbin_res"

    @staticmethod
    def recognises(head: bytes) -> bool:
        """A Jet or ACE data base."""
        return head.startswith(JET)

    @staticmethod
    def read(data: bytes) -> dict[str, np.ndarray]:
        """Columns of the one channel of the file, in the order of its data points.

        Raises
        ------
        Refusal
            mdb-export is not installed, finds no such table, or misses pages of the file; the file
            holds several tests.
        """
        text = _exported(data, "Channel_Normal_Table")
        layout = layout_of(text)
        fields = known_fields(layout.labels, meaning)
        require(fields, SERIES, SPELT)
        extra = [label for label in ("Test_ID", "Data_Point", "DateTime") if label in layout.labels]
        found, _ = read_table(text, layout, [*(field.label for field in fields), *extra])
        tests = np.unique(found.get("Test_ID", np.zeros(1)))
        if len(tests) > 1:
            raise Refusal(f"the data base holds {len(tests)} tests; one test a file is wanted")
        columns = converted(found, fields)
        if "DateTime" in found:
            days = found["DateTime"] - EXCEL_EPOCH_DAY
            columns["unix_time_second"] = days * DAY_SECOND
        # A data base has no order of rows: they come as they lie on its pages.
        order = np.argsort(found["Data_Point"], kind="stable")
        return {name: values[order] for name, values in columns.items()}


class NewareBinary:
    """Neware's .nda and .ndax, by fastnda (BSD licence)."""

    NAME = "neware_binary"

    @staticmethod
    def recognises(head: bytes) -> bool:
        """A NEWARE mark, or a zip archive of .ndc files."""
        archive = head.startswith(b"PK\x03\x04")
        return head.startswith(b"NEWARE") or (
            archive and (b".ndc" in head or b"VersionInfo" in head)
        )

    @staticmethod
    def read(data: bytes) -> dict[str, np.ndarray]:
        """Columns of the file.

        Raises
        ------
        Refusal
            fastnda is not installed, or cannot read the file.
        """
        if importlib.util.find_spec("fastnda") is None:
            raise Refusal(
                "a Neware nda or ndax file is read by fastnda, which is not installed: "
                "`./run python -m pip install 'fastnda>=1.3'`, or export the test as csv"
            )
        # Of a damaged archive it would give what is left; such a one has not come this far.
        return _of_neware(data, ".ndax" if data.startswith(b"PK") else ".nda")


def _of_neware(data, suffix):
    import fastnda

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file{suffix}"
        path.write_bytes(data)
        try:
            frame = fastnda.read(str(path))
        except FAULTS as fault:
            raise Refusal(f"fastnda cannot read the file: {fault}") from None
    if not frame.height:
        raise Refusal("the Neware file holds no reading")
    columns = {
        "test_time_second": frame["total_time_s"].to_numpy().astype(float),
        "current_ampere": frame["current_mA"].to_numpy().astype(float) / 1000,
        "voltage_volt": frame["voltage_V"].to_numpy().astype(float),
        "step_index": frame["step_index"].to_numpy().astype(np.int64),
        "cycle_count": frame["cycle_count"].to_numpy().astype(np.int64),
        "unix_time_second": frame["unix_time_s"].to_numpy().astype(float),
    }
    probes = [name for name in frame.columns if name.endswith("temperature_degC")]
    if probes:
        columns["surface_temperature_celsius"] = frame[probes[0]].to_numpy().astype(float)
    return columns


def _exported(data, table):
    """A table of a Jet data base as csv."""
    program = shutil.which("mdb-export")
    if program is None:
        raise Refusal(
            "an Arbin res file is read by mdb-export, which is not installed (Debian: "
            "mdbtools); or export the test as csv or xlsx"
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file.res"
        path.write_bytes(data)
        command = [program, "-Q", str(path), table]
        try:
            done = subprocess.run(command, capture_output=True, timeout=SLOWEST, check=False)
        except subprocess.TimeoutExpired:
            raise Refusal(f"mdb-export took longer than {SLOWEST:g} s") from None
    said = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if done.returncode or not done.stdout.strip():
        raise Refusal(f"mdb-export finds no {table}: {said[0] if said else 'the file is damaged'}")
    # Of a file that is cut off it gives the rows on the pages that are left; of a whole one it says
    # nothing.
    if said:
        raise Refusal(f"the data base is cut off or damaged, mdb-export says: {said[0]}")
    return done.stdout
