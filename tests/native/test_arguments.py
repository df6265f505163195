"""Arrays on their way into a kernel: what has another layout or type is refused at every call."""

import ctypes

import numpy as np
import pytest

from cellwright.native import array, integers


@pytest.mark.parametrize(
    "values",
    [
        np.zeros((4, 4))[:, 1],
        np.zeros((3, 3), order="F"),
        np.zeros(3, np.float32),
        np.zeros(3, ">f8"),
        np.zeros(3, np.int64),
        [1.0, 2.0],
        None,
    ],
)
def test_another_array_is_refused(values):
    with pytest.raises(TypeError):
        array.from_param(values)


@pytest.mark.parametrize("writeable", [True, False])
@pytest.mark.parametrize(("kind", "dtype"), [(array, np.float64), (integers, np.int64)])
def test_a_kernel_gets_the_address_of_the_first_value(kind, dtype, writeable):
    values = np.arange(5, dtype=dtype)[2:]
    values.flags.writeable = writeable
    copy = np.empty(3, dtype)
    move = ctypes.CDLL(None)["memcpy"]
    move.argtypes, move.restype = (kind, kind, ctypes.c_size_t), None
    move(copy, values, values.nbytes)
    assert np.array_equal(copy, [2, 3, 4])


def test_an_empty_array_is_allowed():
    assert array.from_param(np.zeros(0)) is not None
