"""MATLAB's files: objects that MATLAB alone can read are named, with what to do."""

import struct
from io import BytesIO

import numpy as np
import pytest
from scipy.io import savemat

from cellwright import formats
from cellwright.refusal import Refusal


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def with_object(name, kind):
    """A file of MATLAB 7 whose one variable is an object of a class, as MATLAB lays it."""
    numbers = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1))
    numbers += element(1, b"") + element(6, np.array([0xDD000000, 2, 1, 1, 1, 1], "<u4").tobytes())
    body = element(6, struct.pack("<II", 17, 0)) + element(1, name)
    body += element(1, b"MCOS") + element(1, kind) + element(14, numbers)
    return b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM" + element(14, body)


@pytest.mark.parametrize(("kind", "way"), [
    ("table", r"writetable\(T, 'file.csv'\), or as a structure of arrays, s = table2struct"),
    ("timetable", r"writetimetable\(T, 'file.csv'\)"),
])  # fmt: skip
def test_a_table_of_matlab_is_named_with_what_to_do(kind, way):
    with pytest.raises(Refusal, match=f"variable 'T' is a {kind} of MATLAB.*{way}"):
        formats.read(with_object(b"T", kind.encode()), name="file")


def test_variables_of_other_names_are_refused_as_such():
    file = BytesIO()
    savemat(file, {"a": np.arange(4.0), "b": np.arange(4.0)})
    with pytest.raises(Refusal, match="one set of arrays of time, current and voltage is wanted"):
        formats.read(file.getvalue(), name="file")
